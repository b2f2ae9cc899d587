"""Time between events against the Zeno bounds of the paper's proofs, t* >= a2/µ and b2/µ.

Between two events the command moves from the held value by a1 |held| + a2 or more, at no more
than µ per second, so that at least a2/µ passes. µ is measured on the saturated command,
because the triggers compare after saturation, from one control step to the next: rates between
samples are not seen, and a jump counts as its height per period.
"""

from typing import Any

import numpy as np

from ftc_autopilot.common.schedule import Schedule
from gcs.results.quantities import PAPER_ORDER
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS, THROTTLE
from sitl_plant.airframe.level_flight import largest_thrust

_SURFACES = PAPER_ORDER[1:]
WIRE_ROUNDING = 2.0**-24
"""Largest error of a held command, a float32 share of its limit, as a share of that limit."""


def in_force(schedule: Schedule[Any], time_s: np.ndarray) -> np.ndarray:
    """Return the value of a schedule at each time [s]; a window includes its last instant."""
    untils, values = zip(*schedule.windows(), strict=True)
    chosen: np.ndarray = np.array(values, dtype=np.float64)[np.searchsorted(untils, time_s)]
    return chosen


def dwell_times(recording: Recording, i: int, scenario: Scenario) -> dict[str, Any]:
    """Return the smallest interval of each channel of UAV index i and its bound.

    Returns:
        Per channel, with n (throttle) or deg (surfaces) for *: `events`, `min_interval_s`,
        `intervals`, `intervals_of_one_period`, `mu_*_s` and `mu_unsaturated_*_s` (largest rate
        of the command), `threshold_*` (smallest a2 or b2 that was in force), `bound_s`
        (threshold/µ; joint surfaces share the largest µ of the three), `bound_below_period`,
        `intervals_below_bound` (each against the threshold in force at its end), `held`.
        Missing values are None.
    """
    demand, limits = _demand(recording, i, scenario)
    mu = _largest_rates(np.clip(demand, *limits), recording)
    mu_unsaturated = _largest_rates(demand, recording)
    pace = dict(mu)
    if scenario.trigger.mode == "joint":
        pace.update(dict.fromkeys(_SURFACES, max(mu[name] for name in _SURFACES)))
    channels: dict[str, Any] = {}
    for name in PAPER_ORDER:
        unit = "n" if name == "throttle" else "deg"
        events = recording.signals["events"][:, i] >> ACTUATORS.index(name) & 1
        at = np.flatnonzero(events)
        gaps = np.diff(at)
        channels[name] = {
            "events": len(at),
            "min_interval_s": int(gaps.min()) * recording.step_us / 1e6 if len(gaps) else None,
            "intervals": len(gaps),
            "intervals_of_one_period": int(np.count_nonzero(gaps == 1)),
            f"mu_{unit}_s": mu[name],
            f"mu_unsaturated_{unit}_s": mu_unsaturated[name],
            **_against_bound(recording, i, scenario, name, at, pace[name]),
        }
    return channels


def _demand(
    recording: Recording, i: int, scenario: Scenario
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return the command before saturation [deg, deg, deg, N], and its limits, all (steps, 4)."""
    demand = recording.signals["demand"][:, i].copy()
    demand[:, :3] = np.degrees(demand[:, :3])
    aircraft = scenario.aircraft_of(recording.uav_ids[i])
    lowest, highest = np.array([*aircraft.stops_deg, (0.0, aircraft.thrust_limit_n)]).T
    highest = np.tile(highest, (len(demand), 1))
    if aircraft.propulsion is not None:
        airspeeds = recording.signals["V"][:, i].tolist()
        highest[:, THROTTLE] = [largest_thrust(aircraft, V) for V in airspeeds]
    return demand, (lowest, highest)


def _largest_rates(command: np.ndarray, recording: Recording) -> dict[str, float]:
    """Return the largest change per period by channel [deg/s, N/s]; 0 if there is none."""
    with np.errstate(invalid="ignore"):
        changes = np.abs(np.diff(command, axis=0)) / (recording.step_us / 1e6)
    changes = changes[np.isfinite(changes).all(axis=1)]
    largest = changes.max(axis=0, initial=0.0)
    return {name: float(value) for name, value in zip(ACTUATORS, largest, strict=True)}


def _against_bound(
    recording: Recording, i: int, scenario: Scenario, name: str, at: np.ndarray, pace: float
) -> dict[str, Any]:
    trigger, period_s = scenario.trigger, recording.step_us / 1e6
    aircraft = scenario.aircraft_of(recording.uav_ids[i])
    if name == "throttle":
        unit, schedule, limit = "n", trigger.a2_n, aircraft.thrust_limit_n
    else:
        stops = aircraft.stops_deg[ACTUATORS.index(name)]
        unit, schedule, limit = "deg", trigger.b2_deg, max(map(abs, stops))
    keys = ("bound_s", "bound_below_period", "intervals_below_bound", "held")
    result: dict[str, Any] = {f"threshold_{unit}": None, **dict.fromkeys(keys)}
    if not trigger.BY_THRESHOLD or not len(recording.time_s):
        return result
    threshold = in_force(schedule, recording.time_s)
    result[f"threshold_{unit}"] = smallest = float(threshold.min())
    if pace > 0.0:
        result["bound_s"] = smallest / pace
        result["bound_below_period"] = smallest / pace < period_s
    if len(at) > 1:
        moved = np.diff(at) * pace * period_s  # the most that the command can have moved
        below = moved < (threshold[at[1:]] - WIRE_ROUNDING * limit) * (1.0 - 1e-9)
        result["intervals_below_bound"] = int(np.count_nonzero(below))
        result["held"] = not below.any()
    return result

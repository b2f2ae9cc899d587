"""Flights by sensors, watched: what estimators exclude, how wrong they are, and what they claim."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.state import TESTED
from gcs.fleet.in_process import InProcessFlight, begin, fly_on
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from sitl_plant.sensing.units import FAULT_NAMES

SETTLED_S = 10.0
_LOOK_S = 0.02
_WINDOW = 500  # looks, of which errors are compared with their standard deviations


class Exclusion(NamedTuple):
    """A sensor excluded, or taken back."""

    time_s: float
    uav: int
    sensor: str
    excluded: bool


class Watched(NamedTuple):
    """A flight by sensors.

    Attributes:
        steps: What was flown, until it was lost.
        exclusions: Sensors excluded and taken back.
        claimed: Standard deviations of attitude [rad] and place [m], over all axes, by look;
            shape (looks, n, 2).
        resets: Times that an estimate jumped or began again in flight, by aircraft.
    """

    steps: Steps
    exclusions: list[Exclusion]
    claimed: np.ndarray
    resets: np.ndarray


def watched(scenario: Scenario, begins_again_s: float | None = None) -> Watched:
    """Fly a scenario by sensors, and look every 20 ms at what the estimators make of them.

    Args:
        scenario: The scenario.
        begins_again_s: When all estimators begin again, as after a restart [s].
    """
    flight, n = begin(scenario), len(scenario.uavs)
    steps = Steps.room(scenario.steps, n, estimated=True)
    estimators = flight.estimates.estimators
    report, new = estimators["report"], estimators.copy()
    new["progress"]["step"] = -1
    exclusions: list[Exclusion] = []
    bad: set[tuple[int, str]] = set()
    claimed = []
    end = scenario.steps
    for first, last in _looks(scenario, begins_again_s):
        if begins_again_s is not None and first == _step(scenario, begins_again_s):
            estimators[:] = new
        end_s = last * scenario.step_us / 1e6
        part = scenario.model_copy(update={"duration_s": end_s})
        ending = fly_on(part, flight, steps.part, first=first)
        now = set(_excluded(flight))
        exclusions += [Exclusion(end_s, *one, excluded=one in now) for one in sorted(bad ^ now)]
        bad = now
        if ending.loss is not None:
            end = ending.steps
            break
        both = report["attitude_std"], report["position_std"]
        claimed.append(np.stack([np.linalg.norm(one, axis=-1) for one in both], axis=-1))
    return Watched(steps.part(0, end), exclusions, np.array(claimed), report["resets"].copy())


def _step(scenario: Scenario, time_s: float) -> int:
    return round(time_s * 1e6 / scenario.step_us)


def _looks(scenario: Scenario, begins_again_s: float | None) -> Iterator[tuple[int, int]]:
    """Yield the steps between looks, from one up to another."""
    ends = set(range(0, scenario.steps, _step(scenario, _LOOK_S))) | {scenario.steps}
    if begins_again_s is not None:
        ends.add(_step(scenario, begins_again_s))
    ordered = sorted(ends)
    yield from pairwise(ordered)


def _excluded(flight: InProcessFlight) -> Iterator[tuple[int, str]]:
    for uav, estimator in zip(flight.ids, flight.estimates.estimators, strict=True):
        report = estimator["report"]
        for k in range(3):
            if int(report["bad_imus"]) >> k & 1:
                yield uav, f"imu {k + 1}"
        for k in TESTED:
            if int(report["bad_sensors"]) >> k & 1:
                yield uav, (*FAULT_NAMES, "gps velocity", "gps height")[k]


class Errors(NamedTuple):
    """Largest errors of all estimates after a time."""

    tilt_deg: float  # roll or pitch
    yaw_deg: float
    airspeed_m_s: float
    place_m: float


def _off(steps: Steps) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of the angles, shape (steps, n, 3), and of the place, (steps, n)."""
    turned = steps.estimates[..., 6:9] - steps.states[..., 6:9]
    place = np.linalg.norm(steps.estimates[..., :3] - steps.states[..., :3], axis=-1)
    return np.abs((turned + np.pi) % (2.0 * np.pi) - np.pi), place


def errors_of(steps: Steps, step_us: int, settled_s: float = SETTLED_S) -> Errors:
    """Return the largest errors after a time.

    Args:
        steps: A flight by sensors.
        step_us: Its control period.
        settled_s: The time.
    """
    first = round(settled_s * 1e6 / step_us)
    turned, place = _off(steps)
    true, estimated = steps.states[first:], steps.estimates[first:]
    through = np.linalg.norm(true[..., 3:6] - steps.wind[first:], axis=-1)
    shown = np.linalg.norm(estimated[..., 3:6] - estimated[..., 12:15], axis=-1)
    angles = np.degrees(turned[first:])
    parts = angles[..., :2], angles[..., 2], np.abs(shown - through), place[first:]
    return Errors(*(float(part.max(initial=0.0)) for part in parts))


def added_m(again: Steps, other: Steps, first: int) -> float:
    """Return the largest distance between errors of the place in two flights, from a step on [m].

    Sensors of a seed err alike in both: what is left is what the estimators made otherwise.
    """
    length = min(again.length, other.length)
    errors = (
        one.estimates[first:length, :, :3] - one.states[first:length, :, :3]
        for one in (again, other)
    )
    return float(np.linalg.norm(np.subtract(*errors), axis=-1).max(initial=0.0))


def times_claimed(watch: Watched, scenario: Scenario, settled_s: float = SETTLED_S) -> float:
    """Return errors over what is claimed: of attitude or place, the worst 10 s of an aircraft."""
    turned, place = _off(watch.steps)
    stride = _step(scenario, _LOOK_S)
    errors = np.stack([np.linalg.norm(turned, axis=-1), place], axis=-1)[stride - 1 :: stride]
    first = round(settled_s / _LOOK_S)
    n = min(len(errors), len(watch.claimed))
    worst = 0.0
    for start in range(first, max(n - _WINDOW, first) + 1, _WINDOW // 5):
        both = (np.square(x[start : start + _WINDOW]) for x in (errors[:n], watch.claimed[:n]))
        off, claimed = (np.mean(x, axis=0) for x in both)
        worst = max(worst, float(np.sqrt(off / claimed).max(initial=0.0)))
    return worst

"""How little roll a stuck aileron can cost: full rudder at once, and nothing better than that.

    python -m benchmarks.least_roll
    python -m benchmarks.least_roll c172p --after 0.1

When the aileron sticks, the rudder alone can stop the roll, by the sideslip that it makes. From the
moment that a designed scenario is in when `benchmarks.airframes` lets it stick, the linear lateral
motion is flown with the rudder on its way to either stop from a time after the fault on, by the
scenario's servo: as far as the linear model holds, no law that learns of the fault then makes the
largest roll smaller. After 0 s is a law that knows at once.
"""

import argparse
import math

import numpy as np

from benchmarks.airframes import AIRFRAMES, FROM_S, STUCK_DEG, designed
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, RUDDER
from sitl_plant.airframe.aerodynamics import lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

_DT = 1e-3
_MAX_S = 4.0
_PAPER_S = 24.0
_MEAN_S = 0.5  # over which commands are averaged to what balances the aircraft


def balance_of(scenario: Scenario) -> tuple[float, float, float]:
    """Return airspeed [m/s], aileron and rudder [rad] of a flight when the fault would begin."""
    begin_s = FROM_S * scenario.duration_s / _PAPER_S
    flight = fly_in_process(scenario.model_copy(update={"duration_s": begin_s, "faults": ()}))
    applied = flight.applied[-round(_MEAN_S / _DT) :, 0].mean(axis=0)
    speed = float(np.linalg.norm(flight.states[-1, 0, 3:6]))
    return speed, float(applied[AILERON]), float(applied[RUDDER])


def least_roll(scenario: Scenario, stuck_rad: float, after_s: float) -> float:
    """Return the largest roll [rad] with full rudder from a time after the fault on [s].

    Infinite if neither stop turns the aircraft back within 4 s.
    """
    speed, aileron, rudder = balance_of(scenario)
    aircraft = scenario.aircraft_of(scenario.uavs[0].id)
    servo = scenario.servos.surfaces
    model = lateral_model(aircraft, speed)
    rate = math.inf if servo.rate_limit_deg_s is None else math.radians(servo.rate_limit_deg_s)
    stops = (math.radians(stop) - rudder for stop in aircraft.stops_deg[RUDDER])
    found = (
        _largest(model, stuck_rad - aileron, stop, after_s, servo.lag_s, rate) for stop in stops
    )
    return min(found)


def lateral_model(aircraft: Aircraft, speed: float) -> np.ndarray:
    """Return [A B], shape (4, 6): β, p, r, φ by themselves, by aileron and by rudder.

    The model is about straight, level flight at a speed [m/s], as of the rudder's gains.
    """
    a = aircraft_record(aircraft)
    air = lateral(speed, a)
    rolling, yawing = (
        [c.beta, c.p, c.r, 0.0, c.aileron, c.rudder] for c in (air.rolling, air.yawing)
    )
    p_dot, _, r_dot = a["J_inv"] @ (air.scale * np.array([rolling, [0.0] * 6, yawing]))
    side, momentum = air.side, a["m"] * speed
    by_side = np.array([side.beta, side.p, side.r, 0.0, side.aileron, side.rudder]) / momentum
    beta_dot = by_side + np.array([0.0, 0.0, -1.0, a["g"] / speed, 0.0, 0.0])
    return np.array([beta_dot, p_dot, r_dot, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]])


def _largest(
    model: np.ndarray, aileron: float, stop: float, after_s: float, lag_s: float, rate: float
) -> float:
    x, rudder, largest = np.zeros(4), 0.0, 0.0
    for k in range(round(_MAX_S / _DT)):
        command = stop if k * _DT >= after_s else 0.0
        change = (command - rudder) * min(_DT / lag_s if lag_s > 0.0 else 1.0, 1.0)
        rudder += min(max(change, -rate * _DT), rate * _DT)
        x = x + _DT * (model @ np.array([*x, aileron, rudder]))
        largest = max(largest, abs(float(x[3])))
        if rudder != 0.0 and x[1] * x[3] < 0.0:
            return largest
    return math.inf


def row(*cells: object) -> str:
    """Return a row of a table in Markdown."""
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.least_roll", description=__doc__)
    able = [name for name in AIRFRAMES if designed(name, "surviving").aircraft.has("rudder")]
    parser.add_argument("airframes", nargs="*", choices=[*able, []], help="all unless given")
    parser.add_argument("--stuck", type=float, nargs="+", default=[0.0, STUCK_DEG], help="at [deg]")
    parser.add_argument("--after", type=float, nargs="+", default=[0.0, 0.1, 0.2], help="[s]")
    options = parser.parse_args()
    print(
        row("airframe", "stuck at [deg]", *(f"after {1e3 * t:g} ms [deg]" for t in options.after))
    )
    print(row("---", *(["---:"] * (1 + len(options.after)))))
    for airframe in options.airframes or able:
        scenario = designed(airframe, "surviving")
        for stuck in options.stuck:
            rolls = (least_roll(scenario, math.radians(stuck), after) for after in options.after)
            print(
                row(airframe, f"{stuck:g}", *(f"{math.degrees(x):.1f}" for x in rolls)), flush=True
            )


if __name__ == "__main__":
    main()

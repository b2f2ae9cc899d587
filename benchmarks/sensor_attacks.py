"""Flights by sensors under attack: single faults, pairs, any healthy air, no compass, restarts.

    python -m benchmarks.sensor_attacks
    python -m benchmarks.sensor_attacks healthy singles --flights 20 --seed 7

A row is a family: flights that were kept; faults that were noticed, and after how long at the most;
how long after its end a faulty sensor was taken back; healthy sensors and actuators that were
blamed; sensors that were still out at the end; estimates that jumped; and of all aircraft the
largest errors, and the worst 10 s of errors over what is claimed of them. Where estimators begin
again, `added` is the most by which errors of the place differ from the ones of the same flight in
which they do not: the receiver's own error is in both. Flights that were lost, blamed somebody, or
were slow are listed below, with what was excluded and taken back (UAV, sensor, second), and which
actuators were lost. Faults are UAV 1's.
"""

import argparse
import itertools
import math
import multiprocessing
import os
import random
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.sensor_flights import Errors, Exclusion, added_m, errors_of, times_claimed, watched
from ftc_autopilot.common.phases import LOST
from ftc_lab.reports.markdown import table
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.scenario.sections import ScenarioFault
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.sensors import FAILURES, SENSOR_NAMES

S1, RACE, HEXAGON = "paper/scenario1", "missions/race_track", "missions/hexagon"
LAWS = ("surviving", "tube")
IMU = ("gyro", "accelerometer")
AIRFRAMES = {
    S1: 45.0,
    "airframes/aerosonde": 24.0,
    "airframes/skywalker_x8": 18.0,
    "airframes/minisgs": 18.0,
    "airframes/pa28": 55.0,
    "airframes/pc7": 80.0,
    "airframes/c172p": 55.0,
    "airframes/mixed": 24.0,
}
"""Scenarios of aircraft, with their airspeed [m/s]: gusts are smaller for slow ones."""
STEPS_US = (1000, 2000, 4000, 5000, 10_000)
_LATE_S, _SLOW_S = 0.7, 10.0  # of a fault that is noticed; of a sensor that is taken back
_FITTED_S = 0.1  # what is not fitted is excluded before


class Case(NamedTuple):
    """A flight: its name, scenario, and what is changed of that.

    Attributes:
        again_s: When all estimators begin again [s].
        settled_s: From when on errors count [s].
    """

    name: str
    scenario: str
    changes: dict[str, Any]
    again_s: float | None = None
    settled_s: float = 5.0


def fault(sensor: str, start_s: float, end_s: float, **value: Any) -> Any:
    return {"uav": 1, "sensor": sensor, "start_s": start_s, "end_s": end_s, **value}


def singles(rng: random.Random) -> Iterator[Case]:
    """Each sensor and kind by MAV_CMD_INJECT_FAILURE, under each law; * is all instances."""
    profiles = (S1, 10.0, 16.0, 34.0), (RACE, 25.0, 35.0, 60.0), (HEXAGON, 25.0, 35.0, 60.0)
    for law, (scenario, start_s, end_s, duration_s) in itertools.product(LAWS, profiles):
        for sensor, kind in itertools.product(SENSOR_NAMES, FAILURES):
            for instance in (1, 0) if sensor in IMU else (1,):
                one = fault(sensor, start_s, end_s, instance=instance, failure=kind)
                changes = {"faults": [one], "duration_s": duration_s, "seed": _seed(rng)}
                name = f"{scenario}, {law}: {sensor}{'' if instance else '*'} {kind}"
                yield Case(name, scenario, {**changes, **_law(law)})


def pairs(rng: random.Random) -> Iterator[Case]:
    """Two at a time, for long, or from the start; in calm air and in wind with light turbulence."""
    compass, place = {"bias_gauss": 0.2}, {"bias_m": 50.0}
    named = {
        "GNSS off, compass wrong": [
            fault("gps", 20.0, 50.0, failure="off"),
            fault("magnetometer", 22.0, 50.0, **compass),
        ],
        "GNSS and compass wrong": [
            fault("gps", 20.0, 50.0, **place),
            fault("magnetometer", 20.0, 50.0, **compass),
        ],
        "compass wrong, then GNSS off": [
            fault("magnetometer", 20.0, 60.0, **compass),
            fault("gps", 30.0, 50.0, failure="off"),
        ],
        "IMU 1 off, accelerometer 2 wrong": [
            fault("gyro", 20.0, 40.0, instance=1, failure="off"),
            fault("accelerometer", 24.0, 40.0, instance=2, bias_m_s2=1.0),
        ],
        "both gyros wrong, GNSS off": [
            fault("gyro", 20.0, 40.0, instance=0, failure="wrong"),
            fault("gps", 30.0, 45.0, failure="off"),
        ],
        "both accelerometers wrong": [
            fault("accelerometer", 20.0, 30.0, instance=0, failure="wrong")
        ],
        "pitot fades, GNSS off": [
            fault("airspeed", 20.0, 50.0, fade_s=20.0),
            fault("gps", 30.0, 50.0, failure="off"),
        ],
        "pitot and rudder": [
            fault("airspeed", 20.0, 40.0, scale=0.5),
            {"uav": 1, "actuator": "rudder", "stuck_deg": 5.0, "start_s": 22.0},
        ],
        **{
            f"leak {v:g} Pa/s": [fault("barometer", 20.0, 60.0, drift_pa_s=v)]
            for v in (-5.0, 2.0, 5.0)
        },
        **{
            f"place drifts {v:g} m/s": [fault("gps", 20.0, 60.0, drift_m_s=v, axis="x")]
            for v in (0.2, 0.5, 1.0, 2.0, 5.0)
        },
        **{f"GNSS {v:g} s late": [fault("gps", 20.0, 60.0, delayed_s=v)] for v in (0.3, 0.5)},
        **{f"GNSS {v}": [fault("gps", 20.0, 80.0, failure=v)] for v in ("off", "garbage")},
        "GNSS wrong": [fault("gps", 20.0, 80.0, **place)],
        "pitot 0.8": [fault("airspeed", 20.0, 50.0, scale=0.8)],
        **{
            f"pitot fades in {v:g} s": [fault("airspeed", 20.0, 80.0, fade_s=v)]
            for v in (20.0, 60.0)
        },
        "pitot 0.5 from the start": [fault("airspeed", 0.0, 50.0, scale=0.5)],
        "compass wrong from the start": [fault("magnetometer", 0.0, 50.0, **compass)],
        "GNSS wrong from the start": [fault("gps", 0.0, 50.0, **place)],
        "barometer wrong from the start": [fault("barometer", 0.0, 50.0, bias_pa=120.0)],
        **{
            f"{s} 0.5 s late": [fault(s, 20.0, 50.0, delayed_s=0.5)]
            for s in ("magnetometer", "barometer")
        },
        "GNSS 0.3 s late from the start": [fault("gps", 0.0, 85.0, delayed_s=0.3)],
    }
    for name, faults in named.items():
        duration_s = min(max(one.get("end_s", 0.0) for one in faults) + 45.0, 130.0)
        for air in ("calm", "windy"):
            changes = {"faults": faults, "duration_s": duration_s, "seed": _seed(rng)}
            wind = {"wind": _wind(rng, 8.0, "light")} if air == "windy" else {}
            yield Case(f"{name}, {air}", RACE, {**changes, **wind})


def healthy(rng: random.Random) -> Iterator[Case]:
    """Any aircraft, wind to 38 m/s, gusts, shear, turbulence, heading and control period."""
    while True:
        scenario, speed = rng.choice(list(AIRFRAMES.items()))
        air, wind_m_s = rng.choice(("calm", "gust", "shear", "light", "moderate")), rng.random()
        wind = _wind(rng, 38.0 * wind_m_s, air if air in ("light", "moderate") else "none")
        north, east = _direction(rng)
        if air == "gust":
            peak = rng.uniform(4.0, 12.0) * min(speed / 45.0, 1.0)
            gust = {"start_s": rng.uniform(5.0, 25.0), "duration_s": rng.uniform(3.0, 12.0)}
            wind["gust"] = {**gust, "north_m_s": peak * north, "east_m_s": peak * east}
        elif air == "shear":
            at = scenario_tree(scenario)["uavs"][0]["initial"].get("altitude_m", 0.0)
            wind["shear"] = {"north_1_s": 0.1 * north, "east_1_s": 0.1 * east, "altitude_m": at}
        step_us = rng.choice(STEPS_US) if scenario == S1 else 1000
        changes = {"duration_s": 40.0, "seed": _seed(rng), "step_us": step_us, "wind": wind}
        yaw_deg = rng.uniform(-180.0, 180.0)
        name = f"{scenario}, {air}, {38.0 * wind_m_s:.0f} m/s, {yaw_deg:.0f}°, {step_us} us"
        yield Case(name, scenario, {**changes, "uavs": headed(scenario, yaw_deg)})


def no_compass(rng: random.Random) -> Iterator[Case]:
    """Without a magnetometer, at any heading."""
    sensors = {"navigation": {"magnetometer": {"fitted": False}}}
    while True:
        yaw_deg = rng.uniform(-180.0, 180.0)
        changes = {"duration_s": 40.0, "sensors": sensors, "uavs": headed(S1, yaw_deg)}
        changes |= {"seed": _seed(rng), "wind": _wind(rng, rng.uniform(0.0, 8.0), "light")}
        yield Case(f"no magnetometer, heading {yaw_deg:.0f}°", S1, changes, settled_s=20.0)


def rejoining(rng: random.Random) -> Iterator[Case]:
    """All estimators begin again in flight."""
    while True:
        again_s = round(rng.uniform(8.0, 20.0), 2)
        changes = {"duration_s": 34.0, "seed": _seed(rng), "wind": _wind(rng, 8.0, "light")}
        yield Case(f"again at {again_s:g} s", S1, changes, again_s, settled_s=again_s + 2.0)


def dead_reckoning(rng: random.Random) -> Iterator[Case]:
    """Without a receiver for 120 s, in light turbulence and 8 m/s of wind."""
    while True:
        faults = [fault("gps", 20.0, 140.0, failure="off")]
        changes = {"duration_s": 160.0, "faults": faults, "wind": _wind(rng, 8.0, "light")}
        yield Case("GNSS off for 120 s", RACE, {**changes, "seed": _seed(rng)})


FAMILIES = {
    singles: 336,
    pairs: 60,
    healthy: 300,
    no_compass: 20,
    rejoining: 20,
    dead_reckoning: 10,
}
"""How many flights each has."""


def headed(scenario: str, yaw_deg: float) -> list[Any]:
    """Return the aircraft of a scenario, turned as one about the first."""
    uavs: list[Any] = scenario_tree(scenario)["uavs"]
    return [merged(uav, {"initial": {"yaw_deg": yaw_deg}}) for uav in uavs]


def _seed(rng: random.Random) -> int:
    return rng.randrange(1, 1_000_000)


def _direction(rng: random.Random) -> tuple[float, float]:
    angle = rng.uniform(0.0, 2.0 * math.pi)
    return math.cos(angle), math.sin(angle)


def _wind(rng: random.Random, speed: float, turbulence: str) -> dict[str, Any]:
    north, east = _direction(rng)
    steady = {"north_m_s": speed * north, "east_m_s": speed * east}
    return {"turbulence": turbulence, "steady": steady}


def _law(law: str) -> dict[str, Any]:
    known: dict[str, Any] = {"controller": {"kind": law}}
    return known | scenario_tree("tube") if law == "tube" else known


class Flown(NamedTuple):
    """What became of a case."""

    name: str
    kept: bool
    faults: int
    noticed_s: tuple[float, ...]
    back_s: float  # the last one, after the end of its fault; infinite: never
    blamed: tuple[int, int]  # healthy sensors, actuators
    out: int  # sensors that are out at the end, but for faults that last
    resets: int
    errors: Errors
    times_claimed: float
    added_m: float  # to the errors of the place, by beginning again
    changes: str

    @property
    def is_odd(self) -> bool:
        """Whether it is to be listed."""
        slow = self.back_s > _SLOW_S or max(self.noticed_s, default=0.0) > _LATE_S
        jumped = self.faults == 0 and self.resets > 0
        return not self.kept or slow or jumped or any(self.blamed) or self.out > 0


def scenario_of_case(case: Case) -> Scenario:
    """Return what a case flies."""
    own = {"controller": {"kind": "surviving"}, "navigation": "estimated", "faults": []}
    tree = merged(scenario_tree(case.scenario), own)
    return scenario_of(case.scenario, merged(tree, case.changes))


def fly(case: Case) -> Flown:
    """Fly a case."""
    scenario = scenario_of_case(case)
    watch = watched(scenario, case.again_s)
    steps = watch.steps
    fitted = [one for one in watch.exclusions if one.time_s > _FITTED_S]
    faults = [one for one in scenario.faults if not isinstance(one, ScenarioFault)]
    noticed = (noticed_s(one, fitted) for one in faults)
    lost = list(_lost(steps.signals["phase"], scenario))
    last = {(one.uav, one.sensor): one for one in fitted}.values()
    added = 0.0
    if case.again_s is not None:
        first = round(case.settled_s * 1e6 / scenario.step_us)
        added = added_m(steps, watched(scenario).steps, first)
    return Flown(
        case.name,
        steps.length == scenario.steps,
        len(faults),
        tuple(time for time in noticed if time is not None),
        max((back_s(one, fitted, scenario) for one in faults), default=0.0),
        (
            sum(one.excluded and not is_due(one, faults) for one in fitted),
            max(len(lost) - len(scenario.actuator_faults), 0),
        ),
        sum(one.excluded and not _lasts(one, faults, scenario) for one in last),
        int(watch.resets.sum()),
        errors_of(steps, scenario.step_us, case.settled_s),
        times_claimed(watch, scenario, case.settled_s),
        added,
        ", ".join(
            [
                f"{'-' if one.excluded else '+'}{one.uav} {one.sensor} {one.time_s:.1f}"
                for one in fitted
            ]
            + lost
        ),
    )


def _lost(phases: np.ndarray, scenario: Scenario) -> Iterator[str]:
    """Yield the actuators that were lost, with the first time; phases of shape (steps, N, 4)."""
    for row, uav in enumerate(scenario.uavs):
        for j, name in enumerate(ACTUATORS):
            at = np.flatnonzero(phases[:, row, j] >= LOST)
            if len(at):
                yield f"{uav.id} {name} lost {at[0] * scenario.step_us / 1e6:.1f}"


def _is_of(one: Exclusion, faulty: Any) -> bool:
    """Return whether what was excluded is what a fault is of."""
    name = f"imu {faulty.instance or ''}" if faulty.sensor in IMU else faulty.sensor
    return bool(one.uav == faulty.uav and one.sensor.startswith(name))


def is_due(one: Exclusion, faults: Sequence[Any]) -> bool:
    return any(
        _is_of(one, each) and each.start_s <= one.time_s <= each.end_s + _SLOW_S for each in faults
    )


def _lasts(one: Exclusion, faults: Sequence[Any], scenario: Scenario) -> bool:
    return any(_is_of(one, each) and each.end_s >= scenario.duration_s for each in faults)


def noticed_s(faulty: Any, exclusions: Sequence[Exclusion]) -> float | None:
    """Return after how long a fault was noticed [s]; None if it never was."""
    own = (one.time_s for one in exclusions if one.excluded and _is_of(one, faulty))
    return next((time - faulty.start_s for time in own if time >= faulty.start_s), None)


def back_s(faulty: Any, exclusions: Sequence[Exclusion], scenario: Scenario) -> float:
    """Return how long after the end of a fault its sensor was used again [s]."""
    own = {one.sensor: one for one in exclusions if _is_of(one, faulty)}  # the last ones
    if faulty.end_s >= scenario.duration_s or not own:
        return 0.0
    if any(one.excluded for one in own.values()):
        return math.inf
    return float(max(max(one.time_s for one in own.values()) - faulty.end_s, 0.0))


HEAD = [
    "family",
    "flights",
    "kept",
    "noticed, longest [s]",
    "back after [s]",
    "blamed",
    "still out",
]
HEAD += ["jumps", "tilt, yaw [deg]", "airspeed [m/s]", "place [m]", "times claimed: median, worst"]


def row_of(family: str, flown: Sequence[Flown]) -> list[str]:
    """Return the row of a family."""
    noticed = [time for one in flown for time in one.noticed_s]
    tilt, yaw, airspeed, place = (
        max(each) for each in zip(*(f.errors for f in flown), strict=True)
    )
    sensors, actuators = (sum(each) for each in zip(*(f.blamed for f in flown), strict=True))
    times = sorted(one.times_claimed for one in flown)
    added = max(one.added_m for one in flown)
    return [
        family,
        str(len(flown)),
        str(sum(one.kept for one in flown)),
        f"{len(noticed)} of {sum(one.faults for one in flown)}, {max(noticed, default=0.0):.2f}",
        f"{max(one.back_s for one in flown):.1f}",
        f"{sensors} sensors, {actuators} actuators",
        str(sum(one.out for one in flown)),
        str(sum(one.resets for one in flown)),
        f"{tilt:.1f}, {yaw:.1f}",
        f"{airspeed:.1f}",
        f"{place:.1f}{f', added {added:.1f}' if added > 0.0 else ''}",
        f"{times[len(times) // 2]:.1f}, {times[-1]:.1f}",
    ]


def cases_of(family: Any, flights: int | None, seed: int) -> list[Case]:
    """Return cases of a family: all of them, or as many as asked for, drawn."""
    rng = random.Random(f"{family.__name__} {seed}")
    cases = list(itertools.islice(family(rng), FAMILIES[family]))
    if flights is None or flights >= len(cases):
        return cases
    return [cases[k] for k in sorted(rng.sample(range(len(cases)), flights))]


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sensor_attacks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    names = {family.__name__: family for family in FAMILIES}
    parser.add_argument("families", nargs="*", choices=[*names, []], help="all unless given")
    parser.add_argument("--flights", type=int, help="of each family, drawn; all unless given")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    rows, odd = [], []
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for name in options.families or names:
            cases = cases_of(names[name], options.flights, options.seed)
            flown = list(pool.imap(fly, cases, chunksize=1))
            rows.append(row_of(name, flown))
            odd += [one for one in flown if one.is_odd]
            print(name, file=sys.stderr)
    print(table(HEAD, rows, HEAD[1:]))
    for one in odd:
        numbers = ", ".join(f"{error:.1f}" for error in one.errors)
        lost = "" if one.kept else "LOST "
        print(f"{lost}{one.name}: {numbers}; {one.times_claimed:.1f} times claimed: {one.changes}")


if __name__ == "__main__":
    main()

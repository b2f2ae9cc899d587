"""Flights by sensors under attack: each sensor and kind of fault, pairs, gusts, wind, no compass.

    python -m benchmarks.sensor_attacks
    python -m benchmarks.sensor_attacks healthy gusts --seeds 6
    python -m benchmarks.sensor_attacks airframes

A row is a flight: whether it was kept, what was excluded and taken back (UAV, sensor, second), and
the largest errors of the estimates of all UAVs after it had settled. Faults are UAV 1's.
"""

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

from benchmarks.by_sensors import errors_of, watched
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.faults.sensors import FAILURES, SENSOR_NAMES

S1, RACE = "paper/scenario1", "missions/race_track"
WIND = {"turbulence": "light", "steady": {"north_m_s": -4.0, "east_m_s": 6.9}}
IMU = ("gyro", "accelerometer")
AIRFRAMES = ("aerosonde", "skywalker_x8", "minisgs", "pa28", "pc7", "c172p", "mixed")
SETTLED_S = 5.0


class Case(NamedTuple):
    """A flight: its name, scenario, and what is changed of that."""

    name: str
    scenario: str
    changes: dict[str, Any]


def fault(sensor: str, start_s: float, end_s: float, **value: Any) -> Any:
    return {"uav": 1, "sensor": sensor, "start_s": start_s, "end_s": end_s, **value}


def singles(_seeds: int) -> Iterator[Case]:
    """Each sensor and kind by MAV_CMD_INJECT_FAILURE; * is all instances."""
    for scenario, start_s, end_s, duration_s in ((S1, 10.0, 16.0, 34.0), (RACE, 25.0, 35.0, 70.0)):
        for sensor in SENSOR_NAMES:
            for instances in ((1,), (1, 2)) if sensor in IMU else ((1,),):
                for kind in FAILURES:
                    faults = [
                        fault(sensor, start_s, end_s, instance=i, failure=kind) for i in instances
                    ]
                    name = f"{scenario}: {sensor}{'*' if len(instances) > 1 else ''} {kind}"
                    yield Case(name, scenario, {"faults": faults, "duration_s": duration_s})


def pairs(_seeds: int) -> Iterator[Case]:
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
    }
    for name, faults in named.items():
        end_s = max(one.get("end_s", 0.0) for one in faults)
        changes = {"faults": faults, "duration_s": min(end_s + 45.0, 130.0)}
        yield Case(f"{name}, calm", RACE, changes)
        yield Case(f"{name}, windy", RACE, {**changes, "wind": WIND})


def gusts(_seeds: int) -> Iterator[Case]:
    """One gust of the form 1 - cos, ahead."""
    for peak in (4.0, 6.0, 8.0, 12.0):
        for lasts_s in (3.0, 12.0):
            gust = {"start_s": 12.0, "duration_s": lasts_s, "north_m_s": -peak}
            changes = {"duration_s": 30.0, "wind": {"gust": gust}}
            yield Case(f"gust of {peak:g} m/s in {lasts_s:g} s", S1, changes)


def starts(seeds: int) -> Iterator[Case]:
    """A start in wind, at any heading."""
    for speed in (8.0, 15.0, 20.0, 30.0, 38.0):
        steady = {"north_m_s": 0.7 * speed, "east_m_s": -0.714 * speed}
        for yaw_deg in (0.0, 60.0, 135.0, -90.0):
            for seed in range(1, seeds + 1):
                changes = {"duration_s": 20.0, "seed": seed, "wind": {"steady": steady}}
                name = f"wind of {speed:g} m/s, heading {yaw_deg:g}°, seed {seed}"
                yield Case(name, S1, {**changes, "uavs": headed(yaw_deg)})


def no_compass(_seeds: int) -> Iterator[Case]:
    """Without a magnetometer, at any heading."""
    sensors = {"navigation": {"magnetometer": {"fitted": False}}}
    for yaw_deg in (0.0, 60.0, 90.0, 120.0, 150.0, 170.0, 180.0, -90.0):
        changes = {"duration_s": 30.0, "sensors": sensors, "uavs": headed(yaw_deg)}
        yield Case(f"no magnetometer, heading {yaw_deg:g}°", S1, changes)


def headed(yaw_deg: float) -> list[Any]:
    uavs: list[Any] = scenario_tree(S1)["uavs"]
    return [merged(uav, {"initial": {"yaw_deg": yaw_deg}}) for uav in uavs]


def healthy(seeds: int) -> Iterator[Case]:
    """Flights without a fault, to severe turbulence."""
    for seed in range(1, seeds + 1):
        yield Case(f"scenario 1, seed {seed}", S1, {"seed": seed})
        for turbulence in ("light", "moderate", "severe"):
            wind = {"turbulence": turbulence, "steady": {"north_m_s": 3.0, "east_m_s": 4.0}}
            changes = {"seed": seed, "duration_s": 70.0, "wind": wind}
            yield Case(f"race-track, {turbulence}, seed {seed}", RACE, changes)


def airframes(_seeds: int) -> Iterator[Case]:
    """Other aircraft in turbulence, without a fault."""
    for name in AIRFRAMES:
        for turbulence in ("light", "moderate"):
            wind = {"turbulence": turbulence, "steady": {"north_m_s": 3.0, "east_m_s": 4.0}}
            yield Case(
                f"{name}, {turbulence}", f"airframes/{name}", {"duration_s": 40.0, "wind": wind}
            )


FAMILIES = {
    family.__name__: family
    for family in (singles, pairs, gusts, starts, no_compass, healthy, airframes)
}


def row_of(case: Case) -> tuple[bool, bool, str]:
    """Fly a case; return whether it was kept, whether anything was excluded, and its row."""
    own = {"controller": {"kind": "surviving"}, "navigation": "estimated", "faults": []}
    tree = merged(scenario_tree(case.scenario), {**own, **case.changes})
    scenario = scenario_of(case.scenario, tree)
    flown, exclusions = watched(scenario)
    kept = len(flown.states) == scenario.steps
    fitted = [one for one in exclusions if one.time_s > 0.1]  # what is not there is out at once
    changes = ", ".join(
        f"{'-' if one.excluded else '+'}{one.uav} {one.sensor} {one.time_s:.1f}" for one in fitted
    )
    errors = errors_of(flown, scenario.step_us, SETTLED_S)
    numbers = " | ".join(f"{error:.1f}" for error in errors)
    text = f"| {case.name} | {'kept' if kept else '**lost**'} | {numbers} | {changes} |"
    return kept, any(one.excluded for one in fitted), text


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sensor_attacks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("families", nargs="*", metavar="FAMILY", help=", ".join(FAMILIES))
    parser.add_argument("--seeds", type=int, default=2, help="of starts and healthy flights (2)")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    if unknown := [name for name in options.families if name not in FAMILIES]:
        parser.error(f"no family {unknown[0]}: expected {', '.join(FAMILIES)}")
    with ProcessPoolExecutor(options.workers) as pool:
        for name in options.families or FAMILIES:
            errors = "roll, pitch [deg] | yaw [deg] | airspeed [m/s] | place [m]"
            print(f"\n| {name} | | {errors} | out, back |")
            print("| --- | --- | ---: | ---: | ---: | ---: | --- |")
            found = []
            for kept, excluded, text in pool.map(row_of, FAMILIES[name](options.seeds)):
                print(text, flush=True)
                found.append((kept, excluded))
            survived, blamed = (sum(column) for column in zip(*found, strict=True))
            print(f"\n{survived} of {len(found)} kept, {blamed} excluded a sensor")


if __name__ == "__main__":
    main()

"""Families of faults, drawn and flown: what is found, what is blamed wrongly, what is lost.

    python -m benchmarks.fault_families
    python -m benchmarks.fault_families swinging dead_time --seed 7 --laws tube
    python -m benchmarks.fault_families --hardware realistic

A row for each family and hardware, a column for each law; another seed draws other faults. Laws
that know nothing of faults fly the same ones as rivals.
"""

import argparse
import math
import multiprocessing
import os
import random
import statistics
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ftc_autopilot.common.phases import LOST
from ftc_autopilot.control.laws import KINDS
from ftc_lab.reports.laws import LawRow, Value, law_markdown
from gcs.fleet.in_process import fly_in_process
from gcs.results.rivals import SIMPLEST_FIRST
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import ACTUATORS, SURFACES

UAV = 3
"""Follower 2 has the faults."""
DIAGNOSING = ("surviving", "tube")
"""Laws that find faults."""
HARDWARE = ("ideal", "realistic", "turbulent")
_BALANCED = {"aileron": (-2.0, 10.0), "elevator": (-5.0, 5.0), "rudder": (6.0, 34.0)}  # deg
_OVERTURNED_DEG, _HEADING_LOST_DEG = 90.0, 15.0
_KEPT_DEG, _RECOVERED_DEG, _LAST_STEPS = 45.0, 10.0, 1000
_BOUNDS = ((statistics.median, 1.2, 1.0), (max, 1.5, 3.0))
"""How far a law may be off beside the best of the simpler ones: times, and more [deg]."""

Fault: TypeAlias = dict[str, Any]
Keys: TypeAlias = dict[str, Any]


def from_the_start(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Stuck before the start."""
    return _stuck_at(0.0, rng)


def soon_after_start(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Stuck while the control check is made, or soon after it."""
    return _stuck_at(rng.uniform(0.0, 0.6), rng)


def _stuck_at(start_s: float, rng: random.Random) -> tuple[list[Fault], Keys]:
    actuator = rng.choice(ACTUATORS)
    if actuator == "throttle":
        stuck = {"stuck_n": rng.uniform(700.0, 900.0)}
    else:
        stuck = {"stuck_deg": rng.uniform(*_BALANCED[actuator])}
    return [_of(actuator, start_s, **stuck)], {"duration_s": 10.0}


def swinging(rng: random.Random) -> tuple[list[Fault], Keys]:
    """A surface that works, with an oscillating bias."""
    bias = {"bias_deg": rng.uniform(3.0, 10.0), "frequency_hz": _log_uniform(rng, 0.1, 10.0)}
    return [_of(rng.choice(SURFACES), rng.uniform(2.0, 16.0), **bias)], {}


def stuck_swinging(rng: random.Random) -> tuple[list[Fault], Keys]:
    """A surface that does not work, and oscillates."""
    stuck = {"stuck_deg": 5.0, "frequency_hz": _log_uniform(rng, 0.1, 10.0)}
    return [_of(rng.choice(SURFACES), 10.0, **stuck)], {}


def weak_aileron(rng: random.Random) -> tuple[list[Fault], Keys]:
    """An aileron with little of its effectiveness, for good."""
    return [_of("aileron", rng.uniform(5.0, 19.0), effectiveness=rng.uniform(0.05, 0.4))], {}


def weak_in_turns(rng: random.Random) -> tuple[list[Fault], Keys]:
    """An aileron with less than that, under steps of heading."""
    fault = _of("aileron", rng.uniform(4.0, 10.0), effectiveness=rng.uniform(0.05, 0.3))
    return [fault], {"profile": _steps_of_heading(rng, 18.0, 35.0, bank=0.0)}


def weak(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Any surface with some of its effectiveness, for good."""
    effectiveness = rng.uniform(0.05, 0.9)
    return [_of(rng.choice(SURFACES), rng.uniform(3.0, 19.0), effectiveness=effectiveness)], {}


def biased(rng: random.Random) -> tuple[list[Fault], Keys]:
    """A surface that works, with a bias, for good."""
    return [_of(rng.choice(SURFACES), rng.uniform(3.0, 19.0), bias_deg=rng.uniform(-10, 10))], {}


def brief(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Any actuator stuck, biased or weak for 0.2 to 1.5 s, in a formation on a hexagon."""
    (fault,), _ = constant(rng)
    fault["start_s"] = round(rng.uniform(15.0, 40.0), 3)
    fault["end_s"] = fault["start_s"] + rng.uniform(0.2, 1.5)
    return [fault], {"scenario": "missions/hexagon", "duration_s": 60.0}


def intermittent(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Faults that come and go, each for 0.2 to 3 s."""
    actuator, effectiveness = rng.choice(SURFACES), rng.choice([0.0, 0.3, 0.6])
    bias = rng.uniform(*_BALANCED[actuator]) if effectiveness == 0.0 else rng.uniform(-5.0, 5.0)
    return [
        _of(
            actuator,
            8.0,
            effectiveness=effectiveness,
            intermittent_deg=bias,
            frequency_hz=0.5 / rng.uniform(0.2, 3.0),
            end_s=20.0,
        )
    ], {}


def drift(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Slow drifts to 4 to 9 deg."""
    rate = _log_uniform(rng, 0.2, 5.0)
    end_s = 8.0 + min(rng.uniform(4.0, 9.0) / rate, 14.0)
    return [_of(rng.choice(SURFACES), 8.0, drift_deg_s=rate * rng.choice([1, -1]), end_s=end_s)], {}


def hardover(rng: random.Random) -> tuple[list[Fault], Keys]:
    """A surface that runs away at its servo's rate."""
    actuator = rng.choice(SURFACES)
    angle = rng.uniform(*_BALANCED[actuator])
    return [_of(actuator, rng.uniform(2.0, 20.0), hardover_deg=angle)], {}


def far_hardover(rng: random.Random) -> tuple[list[Fault], Keys]:
    """An aileron that runs far away at its servo's rate, for 1.5 s."""
    return _far_off("hardover_deg", rng)


def far_stuck(rng: random.Random) -> tuple[list[Fault], Keys]:
    """An aileron stuck so far away, for as long."""
    return _far_off("stuck_deg", rng)


def _far_off(kind: str, rng: random.Random) -> tuple[list[Fault], Keys]:
    start_s = round(rng.uniform(2.0, 20.0), 3)
    angle = rng.choice([1.0, -1.0]) * rng.uniform(9.0, 30.0)
    return [_of("aileron", start_s, end_s=start_s + 1.5, **{kind: angle})], {}


def comes_and_goes(rng: random.Random) -> tuple[list[Fault], Keys]:
    """A surface that is stuck for half of every 0.5 to 10 s, until the end."""
    stuck = {"effectiveness": 0.0, "intermittent_deg": rng.uniform(-4.0, 4.0)}
    frequency_hz = _log_uniform(rng, 0.1, 2.0)
    start_s = rng.uniform(2.0, 6.0)
    return [_of(rng.choice(SURFACES), start_s, frequency_hz=frequency_hz, **stuck)], {}


def constant(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Any actuator stuck, biased or weak, for a while or for good."""
    actuator, start_s = rng.choice(ACTUATORS), rng.uniform(2.0, 22.0)
    throttle = actuator == "throttle"
    kinds: tuple[Fault, ...] = (
        {"stuck_n": rng.uniform(300.0, 1500.0)}
        if throttle
        else {"stuck_deg": rng.uniform(-15, 20)},
        {"bias_n": rng.uniform(-500, 500)} if throttle else {"bias_deg": rng.uniform(-10, 10)},
        {"effectiveness": rng.uniform(0.05, 0.95)},
    )
    fault = _of(actuator, start_s, **rng.choice(kinds))
    if rng.random() < 0.5:
        fault["end_s"] = start_s + rng.uniform(0.5, 6.0)
    return [fault], {}


def pair(rng: random.Random) -> tuple[list[Fault], Keys]:
    """Two constant faults of different actuators, at once or one after the other."""
    faults: list[Fault] = []
    while len(faults) < 2:
        (fault,), _ = constant(rng)
        if fault["actuator"] not in [other["actuator"] for other in faults]:
            faults.append(fault)
    return faults, {}


def wrong_model(rng: random.Random) -> tuple[list[Fault], Keys]:
    """No fault; mass, inertia and coefficients up to 30 % off."""
    tree = scenario_tree("paper/scenario1")

    def share() -> float:
        return rng.uniform(0.7, 1.3)

    inertia = {name: share() for name in ("Jxx", "Jyy", "Jzz", "Jxz")}
    coefficients = {name: share() for name in tree["aircraft"]["coefficients"]}
    return [], {"uncertainty": {"mass": share(), "inertia": inertia, "coefficients": coefficients}}


def healthy(rng: random.Random) -> tuple[list[Fault], Keys]:
    """No fault; such a model, steps of heading and bank or a mission, a gust and wind."""
    _, keys = wrong_model(rng)
    gust = {name: rng.uniform(-15.0, 15.0) for name in ("north_m_s", "east_m_s")}
    gust |= {"start_s": rng.uniform(3.0, 18.0), "duration_s": _log_uniform(rng, 0.3, 5.0)}
    steady = {name: rng.uniform(-5.0, 5.0) for name in ("north_m_s", "east_m_s")}
    keys["wind"] = {"gust": gust | {"down_m_s": rng.uniform(-5.0, 5.0)}, "steady": steady}
    if rng.random() < 0.5:
        return [], keys | {"profile": _steps_of_heading(rng, 5.0, 35.0, bank=20.0)}
    return [], keys | {"scenario": "missions/hexagon", "duration_s": 48.0}


def _steps_of_heading(rng: random.Random, least: float, most: float, bank: float) -> list[Keys]:
    """Draw a profile: a step of heading every 3 to 6 s, and of roll, airspeed and pitch."""
    segments, start_s, yaw_deg = [], 0.0, 0.0
    while start_s < 22.0:
        own = {"roll_deg": rng.uniform(-bank, bank), "pitch_deg": rng.uniform(1.0, 5.0)}
        own["airspeed_m_s"] = rng.uniform(40.0, 52.0)
        segments.append({"start_s": start_s, "yaw_deg": yaw_deg} | own)
        start_s = round(start_s + rng.uniform(3.0, 6.0), 3)
        yaw_deg += rng.choice([1.0, -1.0]) * rng.uniform(least, most)
    return segments


def dead_time(rng: random.Random) -> tuple[list[Fault], Keys]:
    """No fault; servos or gyro come up to 20 ms later than anybody has said."""
    if rng.random() < 0.5:
        return [], {"servos": {"surfaces": {"dead_time_s": _steps(rng.uniform(0.005, 0.02))}}}
    return [], {"sensors": {"gyro_deg_s": {"latency_s": _steps(rng.uniform(0.005, 0.02))}}}


def known_delay(rng: random.Random) -> tuple[list[Fault], Keys]:
    """No fault; servos come up to 40 ms later, as `delay_s` says."""
    delay_s = _steps(rng.uniform(0.02, 0.04))
    return [], {
        "servos": {"surfaces": {"dead_time_s": delay_s}},
        "controller": {"delay_s": delay_s},
    }


FAMILIES: dict[str, Callable[[random.Random], tuple[list[Fault], Keys]]] = {
    family.__name__: family
    for family in (
        from_the_start,
        soon_after_start,
        swinging,
        stuck_swinging,
        weak_aileron,
        weak_in_turns,
        weak,
        biased,
        brief,
        intermittent,
        drift,
        hardover,
        far_hardover,
        far_stuck,
        comes_and_goes,
        constant,
        pair,
        wrong_model,
        healthy,
        dead_time,
        known_delay,
    )
}


class Flown(NamedTuple):
    """What one flight came to."""

    overturned: bool  # or lost
    off_heading: bool  # or lost
    error_deg: float  # largest of roll and pitch; infinite in a flight that was lost
    blamed: bool  # an actuator without a fault was declared lost, of any UAV
    found_s: float  # after the fault's start; NaN if never
    messages: float  # infinite in a flight that was lost: it is shorter than the others
    kept: bool  # roll and pitch always, and at the end nearly, where they should be
    height_m: float = math.nan  # largest error on a mission's path, after 10 s
    slot_m: float = math.nan  # of the formation, the same


def fly(law: str, hardware: str, drawn: tuple[list[Fault], Keys]) -> Flown:
    """Fly scenario 1, or what the family names, with what was drawn."""
    faults, keys = drawn
    scenario = scenario_with(law, hardware, faults, keys)
    flight = fly_in_process(scenario)
    crashed, i = bool(flight.loss), flight.uav_ids.index(UAV)
    start_s = min((fault["start_s"] for fault in faults), default=0.0)
    later = flight.time_s > max(start_s, 1.0)  # control check and trim come before
    all_errors = np.degrees(np.abs(flight.error("reference")[later, i, 1:]))
    errors = all_errors.max(axis=0, initial=0.0)  # of none, if it was lost before the fault
    at_end = all_errors[-_LAST_STEPS:, :2].max(initial=0.0)
    path = summarise(flight, scenario).uavs[i].path if scenario.mission else None
    lost = flight.signals["phase"] == LOST
    guilty = [ACTUATORS.index(fault["actuator"]) for fault in faults]
    innocent = np.ones(lost.shape[1:], bool)
    innocent[i, guilty] = False
    found = flight.time_s[lost[:, i, guilty].any(axis=1)] - start_s
    messages = float((flight.signals["events"][:, i] != 0).sum())
    return Flown(
        crashed or np.degrees(np.abs(flight.states[:, i, 6])).max() > _OVERTURNED_DEG,
        crashed or errors[2] > _HEADING_LOST_DEG,
        math.inf if crashed else float(errors[:2].max()),
        bool(lost[:, innocent].any()),
        float(found[0]) if len(found) else math.nan,
        math.inf if crashed else messages,
        bool(not crashed and errors[:2].max() <= _KEPT_DEG and at_end <= _RECOVERED_DEG),
        *(() if path is None else (path.height_max_m or 0.0, path.slot_max_m or 0.0)),
    )


def tables(flown: Mapping[tuple[str, str], Mapping[str, Sequence[Flown]]]) -> Iterator[str]:
    """Yield the tables: how well laws fly, what they send, and what those that diagnose find.

    Args:
        flown: The flights of each family and hardware, by law: all laws flew the same.
    """
    laws = {law: law for by_law in flown.values() for law in by_law}
    diagnosing = [law for law in laws if law in DIAGNOSING]

    def simpler(law: str, by_law: Mapping[str, Sequence[Flown]]) -> list[Sequence[Flown]]:
        return [by_law[rival] for rival in laws if law in DIAGNOSING and rival not in DIAGNOSING]

    parts: tuple[tuple[str, Callable[..., tuple[Value, ...]], list[str]], ...] = (
        ("overturned; heading > 15° off; roll or pitch off: median, most [deg]", _off, [*laws]),
        (
            "kept (roll and pitch within 45°, at the end 10°); beyond 1.2 times the best of the "
            "simpler laws and 1°: median, beyond 1.5 times and 3°: most [deg]",
            _kept,
            [*laws],
        ),
        ("on a mission: largest error of height, of the slot [m]", _placed, [*laws]),
        ("messages, median", _sent, [*laws]),
        ("wrongly blamed; found; after: median, 95 % [s]", _found, diagnosing),
    )
    for title, cell, shown in parts:
        rows = [
            LawRow(where, {law: cell(by_law[law], simpler(law, by_law)) for law in shown})
            for where, by_law in flown.items()
        ]
        rows = [row for row in rows if any(row.cells.values())]
        if rows:
            head = ("family", "hardware")
            yield f"{title}\n\n{law_markdown(head, rows, {law: law for law in shown})}"


def _off(flown: Sequence[Flown], _: Any) -> tuple[Value, ...]:
    errors = [one.error_deg for one in flown]
    return (
        Value.of(sum(one.overturned for one in flown), 0),
        Value.of(sum(one.off_heading for one in flown), 0),
        Value.of(statistics.median(errors)),
        Value.of(max(errors)),
    )


def _kept(flown: Sequence[Flown], simpler: Sequence[Sequence[Flown]]) -> tuple[Value, ...]:
    kept = sum(one.kept for one in flown)
    best = [min(one.error_deg for one in flights) for flights in zip(*simpler, strict=True)]
    beyond = [
        statistic(
            [
                0.0
                if math.isinf(own.error_deg) and math.isinf(rival)
                else own.error_deg - times * rival - more
                for own, rival in zip(flown, best, strict=True)
            ]
        )
        for statistic, times, more in (_BOUNDS if simpler else ())
    ]
    return Value(str(kept), -kept), *(Value(f"{each:.1f}") for each in beyond)


def _placed(flown: Sequence[Flown], _: Any) -> tuple[Value, ...]:
    if any(math.isnan(one.height_m) for one in flown):
        return ()
    return tuple(
        Value.of(math.inf if any(math.isinf(one.error_deg) for one in flown) else most)
        for most in (max(one.height_m for one in flown), max(one.slot_m for one in flown))
    )


def _sent(flown: Sequence[Flown], _: Any) -> tuple[Value, ...]:
    return (Value.of(statistics.median(one.messages for one in flown), 0),)


def _found(flown: Sequence[Flown], _: Any) -> tuple[Value, ...]:
    found = [one.found_s for one in flown if not math.isnan(one.found_s)]
    times = (np.median(found), np.percentile(found, 95)) if found else ()
    blamed = Value.of(sum(one.blamed for one in flown), 0)  # times: not of the same flights
    return (blamed, Value(str(len(found))), *(Value(f"{time:.3f}") for time in times))


def scenario_with(law: str, hardware: str, faults: list[Fault], keys: Keys) -> Scenario:
    """Return scenario 1, or the one of the keys, with a law, hardware, faults and other keys."""
    tree = scenario_tree(keys.get("scenario", "paper/scenario1"))
    for addition in ([] if hardware == "ideal" else [hardware]) + (
        ["tube"] if law == "tube" else []
    ):
        tree = merged(tree, scenario_tree(addition))
    controller = {"kind": law} | keys.get("controller", {})
    rest = {name: value for name, value in keys.items() if name not in {"controller", "scenario"}}
    return scenario_of(Path(law), merged(tree, rest) | {"controller": controller, "faults": faults})


def _of(actuator: str, start_s: float, **keys: Any) -> Fault:
    return {"uav": UAV, "actuator": actuator, "start_s": round(start_s, 3)} | keys


def _steps(time_s: float) -> float:
    return round(time_s, 3)  # control periods


def _log_uniform(rng: random.Random, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def fly_all(options: argparse.Namespace) -> dict[tuple[str, str], dict[str, list[Flown]]]:
    """Fly what was asked for; families are named as they are done."""
    flown: dict[tuple[str, str], dict[str, list[Flown]]] = {}
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for family in options.families or FAMILIES:
            rng = random.Random(f"{family} {options.seed}")
            drawn = [FAMILIES[family](rng) for _ in range(options.flights)]
            for hardware in options.hardware:
                flown[family, hardware] = {
                    law: pool.map(partial(fly, law, hardware), drawn, chunksize=1)
                    for law in options.laws
                }
            print(family, file=sys.stderr)
    return flown


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fault_families", description=__doc__
    )
    parser.add_argument("families", nargs="*", choices=[*FAMILIES, []], help="all unless given")
    parser.add_argument("--laws", nargs="+", choices=KINDS, default=SIMPLEST_FIRST)
    parser.add_argument("--hardware", nargs="+", default=HARDWARE, choices=HARDWARE)
    parser.add_argument("--flights", type=int, default=40, help="of each family")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    for one in tables(fly_all(options)):
        print(one)


if __name__ == "__main__":
    main()

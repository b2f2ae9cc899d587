"""What designed scenarios fly like: every bundled airframe, all laws, the same six cases.

    python -m benchmarks.airframes
    python -m benchmarks.airframes c172p minisgs --laws tube
    python -m benchmarks.airframes --seeds 50

One UAV flies scenario 1 as `gcs design` wrote it for the airframe, with nothing or one fault:
the rudder weak, or the aileron stuck. Aircraft without a rudder have a weak elevator instead.
A column for each law: laws without a scenario of their own fly the one of `surviving` with the law
and the trigger that `gcs design` makes for the airframe; what it refuses, no such law can fly.
Errors are the largest ones from the reference after the first second.
`--seeds` flies no faults but other noise, and counts healthy actuators that were declared lost;
aircraft flown by our own equations fly as often again in light turbulence.
"""

import argparse
import math
import multiprocessing
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from ftc_lab.design.airframe import airframe_of
from ftc_lab.design.rules import Conditions
from ftc_lab.design.scenario import design_of, plain, sections_of
from ftc_lab.reports.laws import LawRow, Value, law_markdown
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import UavSummary
from gcs.results.rivals import SIMPLEST_FIRST
from gcs.results.summary import summarise
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import AILERON

AIRFRAMES = {
    "c172p": "c172p",
    "minisgs": "minisgs",
    "pc7": "pc7",
    "pa28": "pa28",
    "aerosonde": "aerosonde_designed",
    "skywalker_x8": "skywalker_x8_designed",
}
"""Scenarios in `airframes/` by airframe; with the tube law the name has `_tube` added."""
DIAGNOSING = ("surviving", "tube")
"""Laws with a scenario of their own for each airframe; they find faults, too."""
BRIEF_S, FROM_S = (19.0, 22.0), 10.0
"""When a rudder at 90 % is weak, and from when other faults last, for the paper's aircraft."""
STUCK_DEG, OF_STOP = 3.0, 35.0
"""A stuck aileron: of this angle, and of the same share of its stop as on the paper's aircraft."""
_PAPER_S = 24.0  # of a flight

Fault: TypeAlias = dict[str, Any]


class Case(NamedTuple):
    """A flight."""

    airframe: str
    law: str
    fault: str
    seed: int = 1
    turbulence: str = "none"


class Flown(NamedTuple):
    """What one flight came to."""

    case: Case
    duration_s: float
    loss: str | None
    uav: UavSummary


def faults_of(scenario: Scenario) -> dict[str, list[Fault]]:
    """Return the faults that are tried, by name: on the time scale of a designed scenario."""
    uav = scenario.uavs[0].id
    s = scenario.duration_s / _PAPER_S
    limits = scenario.aircraft_of(uav).fault_limits
    weak = "rudder" if limits.has("rudder") else "elevator"
    _, stop = limits.surfaces_deg[AILERON]
    begin, end = (t * s for t in BRIEF_S)
    later = {"uav": uav, "start_s": FROM_S * s}
    stuck = later | {"actuator": "aileron"}
    return {
        "none": [],
        f"{weak} at 90 %": [
            {"uav": uav, "actuator": weak, "effectiveness": 0.9, "start_s": begin, "end_s": end}
        ],
        f"{weak} at 50 %": [later | {"actuator": weak, "effectiveness": 0.5}],
        "aileron stuck at 0°": [stuck | {"stuck_deg": 0.0}],
        f"aileron stuck at {STUCK_DEG:g}°": [stuck | {"stuck_deg": STUCK_DEG}],
        f"aileron stuck at {STUCK_DEG:g}/{OF_STOP:g} of its stop": [
            stuck | {"stuck_deg": round(STUCK_DEG / OF_STOP * stop, 2)}
        ],
    }


def designed(airframe: str, law: str) -> Scenario:
    """Return the designed scenario of an airframe, flown by its leader alone.

    Raises:
        BadInput: `gcs design` refuses the law for this airframe.
    """
    suffix = "_tube" if law == "tube" else ""
    tree = scenario_tree(f"airframes/{AIRFRAMES[airframe]}{suffix}")
    alone = {"uavs": tree["uavs"][:1], "network": {"leader_access": {1: 1.0}}}
    scenario = scenario_of(Path(airframe), tree | alone)
    if law in DIAGNOSING:
        return scenario
    cruise = scenario.profile[1].airspeed_m_s  # between a slower and a faster segment
    surfaces, gyro = scenario.servos.surfaces, scenario.sensors.gyro_deg_s
    given = Conditions(surfaces.lag_s, surfaces.rate_limit_deg_s, gyro_noise_deg_s=gyro.noise_rms)
    made = design_of(airframe_of(airframe, load_aircraft(airframe), cruise), law, given)
    sections = sections_of(made)
    own = {"controller": plain(sections.controller), "trigger": plain(sections.trigger)}
    return scenario_of(Path(airframe), tree | alone | own)


def fly(case: Case) -> Flown:
    """Fly one case."""
    scenario = designed(case.airframe, case.law)
    changes: dict[str, Any] = {"seed": case.seed, "faults": faults_of(scenario)[case.fault]}
    if case.turbulence != "none":
        changes["wind"] = {"turbulence": case.turbulence}
    scenario = scenario_of(Path(case.airframe), merged(scenario.model_dump(), changes))
    summary = summarise(fly_in_process(scenario), scenario)
    return Flown(case, scenario.duration_s, summary.loss, summary.uavs[0])


def largest_errors(flown: Sequence[Flown]) -> tuple[Value, ...]:
    """Return the largest errors of roll, pitch and yaw from the reference in all flights [deg]."""
    lost = any(one.loss is not None for one in flown)
    errors = (
        [one.uav.max_error[name] or 0.0 for one in flown] for name in ("roll", "pitch", "yaw")
    )
    return tuple(Value.of(math.inf if lost else max(each)) for each in errors)


def sent(flown: Sequence[Flown]) -> tuple[Value, ...]:
    """Return the events: their number, or the least and the most of several flights."""
    events = [math.inf if one.loss is not None else one.uav.events for one in flown]
    return tuple(Value.of(number, 0) for number in (min(events), max(events))[: len(flown)])


def found(flown: Sequence[Flown]) -> tuple[Value, ...]:
    """Return when faults were announced [ms], and how many healthy actuators were."""
    delays_s = [each for one in flown if (each := one.uav.first_delay_s("lost")) is not None]
    when = Value.of(1e3 * max(delays_s), 0) if delays_s else Value("-", math.inf)
    return when, Value.of(sum(one.uav.false_alarms for one in flown), 0)


REFUSED = (Value("refused"),)


def tables(
    flown: Mapping[tuple[str, ...], Mapping[str, Sequence[Flown]]], where: str
) -> Iterator[str]:
    """Yield the tables: errors, events, and what the laws that diagnose announce.

    Args:
        flown: By labels of the row and law; no flights of a law that the airframe cannot have.
        where: Heading of the second label, beside the airframe.
    """
    laws = list(dict.fromkeys(law for by_law in flown.values() for law in by_law))
    parts = (
        ("largest error of roll, pitch, yaw [deg]", largest_errors, laws),
        ("events", sent, laws),
        (
            "announced after [ms], healthy actuators declared lost",
            found,
            [law for law in laws if law in DIAGNOSING],
        ),
    )
    for title, cell, shown in parts:
        rows = [
            LawRow(labels, {law: cell(by_law[law]) if by_law[law] else REFUSED for law in shown})
            for labels, by_law in flown.items()
        ]
        if shown:
            head = ("airframe", where)
            yield f"{title}\n\n{law_markdown(head, rows, {law: law for law in shown})}"


def fly_all(
    options: argparse.Namespace, pool: Any
) -> dict[tuple[str, ...], dict[str, list[Flown]]]:
    """Fly what was asked for: of each airframe its faults, or healthy flights of several seeds."""
    flown: dict[tuple[str, ...], dict[str, list[Flown]]] = {}
    for airframe in options.airframes or AIRFRAMES:
        base = designed(airframe, "surviving")
        able = {law: is_designed(airframe, law) for law in options.laws}
        of = partial(Case, airframe)
        if options.seeds:
            turbulences = ("none", "light") if base.plant.kind == "own" else ("none",)
            seeds = range(1, options.seeds + 1)
            cases = {
                (airframe, each): [of("", "none", seed, each) for seed in seeds]
                for each in turbulences
            }
        else:
            label = f"{airframe}, {base.duration_s:g} s"
            cases = {(label, fault): [of("", fault)] for fault in faults_of(base)}
        for labels, each in cases.items():
            flown[labels] = {
                law: pool.map(fly, [one._replace(law=law) for one in each]) if able[law] else []
                for law in options.laws
            }
        print(airframe, file=sys.stderr)
    return flown


def is_designed(airframe: str, law: str) -> bool:
    """Return whether `gcs design` has a law for an airframe."""
    try:
        designed(airframe, law)
    except BadInput:
        return False
    return True


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.airframes", description=__doc__)
    parser.add_argument("airframes", nargs="*", choices=[*AIRFRAMES, []], help="all unless given")
    parser.add_argument("--laws", nargs="+", choices=SIMPLEST_FIRST, default=SIMPLEST_FIRST)
    parser.add_argument("--seeds", type=int, default=0, help="healthy flights of each instead")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        flown = fly_all(options, pool)
    for one in tables(flown, "turbulence" if options.seeds else "fault"):
        print(one)


if __name__ == "__main__":
    main()

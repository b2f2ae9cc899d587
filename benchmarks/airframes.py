"""What designed scenarios fly like: every bundled airframe, both laws, the same five cases.

    python -m benchmarks.airframes
    python -m benchmarks.airframes c172p minisgs --laws tube
    python -m benchmarks.airframes --seeds 50

One UAV flies scenario 1 as `gcs design` wrote it for the airframe, with nothing or one fault:
the rudder weak, or the aileron stuck. Aircraft without a rudder have a weak elevator instead.
Errors are the largest ones from the reference after the first second.
`--seeds` flies no faults but other noise, and counts healthy actuators that were declared lost;
aircraft flown by our own equations fly as often again in light turbulence.
"""

import argparse
import multiprocessing
import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import UavSummary
from gcs.results.quantities import percent
from gcs.results.summary import summarise
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
"""Scenarios in `airframes/` by airframe; that of the tube law has `_tube` added."""
LAWS = ("surviving", "tube")
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
    turbulence: str = ""


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
    """Return the designed scenario of an airframe, flown by its leader alone."""
    suffix = "_tube" if law == "tube" else ""
    tree = scenario_tree(f"airframes/{AIRFRAMES[airframe]}{suffix}")
    alone = {"uavs": tree["uavs"][:1], "network": {"leader_access": {1: 1.0}}}
    return scenario_of(Path(airframe), tree | alone)


def fly(case: Case) -> Flown:
    """Fly one case."""
    scenario = designed(case.airframe, case.law)
    changes: dict[str, Any] = {"seed": case.seed, "faults": faults_of(scenario)[case.fault]}
    if case.turbulence:
        changes["wind"] = {"turbulence": case.turbulence}
    scenario = scenario_of(Path(case.airframe), merged(scenario.model_dump(), changes))
    summary = summarise(fly_in_process(scenario), scenario)
    return Flown(case, scenario.duration_s, summary.loss, summary.uavs[0])


def line(flown: Flown) -> str:
    """Return a row of the table of faults."""
    case, uav = flown.case, flown.uav
    found_s = uav.first_delay_s("lost")
    found = "" if found_s is None else f"{1e3 * found_s:.0f}"
    flight = f"{case.airframe}, {flown.duration_s:g} s", case.law, case.fault
    saved = uav.events, percent(uav.saving)
    return row(*flight, *saved, *largest_errors([flown]), found, uav.false_alarms)


def largest_errors(flown: Sequence[Flown]) -> Iterator[str]:
    """Yield the largest errors of roll, pitch and yaw from the reference in all flights [deg]."""
    for name in ("roll", "pitch", "yaw"):
        errors = (one.uav.max_error[name] for one in flown)
        yield f"{max(error for error in errors if error is not None):.1f}"


def row(*cells: object) -> str:
    """Return a row of a table in Markdown."""
    return f"| {' | '.join(map(str, cells))} |"


def rows(options: argparse.Namespace, fly_all: Any) -> Iterator[str]:
    """Yield the rows of the table of faults, as they are flown."""
    for airframe in options.airframes or AIRFRAMES:
        for law in options.laws:
            cases = [Case(airframe, law, fault) for fault in faults_of(designed(airframe, law))]
            yield from map(line, fly_all(fly, cases, chunksize=1))


def healthy_rows(options: argparse.Namespace, fly_all: Any) -> Iterator[str]:
    """Yield the rows of the table of healthy flights, as they are flown."""
    for airframe in options.airframes or AIRFRAMES:
        for law in options.laws:
            own = designed(airframe, law).plant.kind == "own"
            for turbulence in ("", "light") if own else ("",):
                of = partial(Case, airframe, law, "none", turbulence=turbulence)
                flown = list(fly_all(fly, [of(seed + 1) for seed in range(options.seeds)]))
                events = [one.uav.events for one in flown]
                counts = (
                    len(flown),
                    sum(one.uav.false_alarms for one in flown),
                    sum(one.loss is not None for one in flown),
                    f"{min(events)} to {max(events)}",
                )
                yield row(airframe, law, turbulence or "none", *counts, *largest_errors(flown))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.airframes", description=__doc__)
    parser.add_argument("airframes", nargs="*", choices=[*AIRFRAMES, []], help="all unless given")
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=LAWS)
    parser.add_argument("--seeds", type=int, default=0, help="healthy flights of each instead")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    errors = "roll [deg]", "pitch", "yaw"
    if options.seeds:
        numbers = ("flights", "declared lost", "crashed", "events", *errors)
        heading, make = ("airframe", "law", "turbulence", *numbers), healthy_rows
    else:
        numbers = ("events", "saved", *errors, "announced after [ms]", "healthy declared lost")
        heading, make = ("airframe", "law", "fault", *numbers), rows
    print(row(*heading))
    print(row(*(["---"] * 3), *(["---:"] * len(numbers))))
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for one in make(options, pool.imap):
            print(one, flush=True)


if __name__ == "__main__":
    main()

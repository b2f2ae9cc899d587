"""How aircraft land in wind: every bundled aircraft with gear, and the Aerosonde on wheels.

    python -m benchmarks.landings --flights 20
    python -m benchmarks.landings paper c172p --laws pid tube --flights 100 --seed 7
    python -m benchmarks.landings paper --fault elevator effectiveness=0.5

A landing begins in level flight before the approach and ends at standstill, in light turbulence and
a steady wind that is drawn with the seed: up to `--wind` from ahead, and up to `--across` from
either side. The turbulence is the one at 10 ft, the lowest height of MIL-F-8785C; a faulty actuator
is so from 5 s on. A landing that ends otherwise is lost. Figures are of the others' hardest
touchdowns: how many were within 3 m of the centre line, and the largest, or median and largest, of
the rest.
"""

import argparse
import math
import multiprocessing
import os
import statistics
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from benchmarks.airframes import designed
from ftc_autopilot.guidance.runway import figures_of
from ftc_lab.reports.markdown import table
from gcs.fleet.in_process import fly_and_summarise
from gcs.results.ground import TouchdownSummary
from gcs.results.rivals import SIMPLEST_FIRST
from gcs.scenario.model import Scenario, load_scenario, scenario_of
from sitl_plant.air.turbulence import dryden

PAPER, ON_WHEELS = "paper", "aerosonde on wheels"
LANDS = (PAPER, "c172p", "pa28", "aerosonde", ON_WHEELS, "skywalker_x8")
NEAR_M = 3.0
"""Distance from the centre line within which a touchdown is good."""
_HEIGHT_M = 40.0
_TURBULENCE = dryden("light", 0.0).model_dump()
_LEVEL_S = 15.0
_FAULT_S = 5.0
_TIMES = 2.5
"""Time of a flight, by the one until touchdown: there is some for another approach."""


class Wind(NamedTuple):
    """Largest ones [m/s]."""

    ahead: float
    across: float


def base_of(name: str, law: str) -> Scenario:
    """Return what an aircraft flies in, with a law."""
    if name != PAPER:
        scenario = designed("aerosonde" if name == ON_WHEELS else name, law)
        if name != ON_WHEELS:
            return scenario
        aircraft = scenario.aircraft_of(1).model_dump(exclude_none=True)
        return _changed(scenario, {"aircraft": aircraft | {"gear": {"kind": "tricycle"}}})
    return _changed(load_scenario("runway/circuit"), {"controller": {"kind": law}})


def landing(name: str, law: str, wind: Wind, fault: dict[str, Any], seed: int) -> Scenario:
    """Return a landing of an aircraft, to be flown.

    Args:
        name: One of LANDS.
        law: What flies it.
        wind: What is drawn.
        fault: Of an actuator, in the keys of a scenario; empty: none.
        seed: Of the wind.
    """
    base = base_of(name, law)
    aircraft, bandwidth = base.aircraft_of(1), base.controller.reference_bandwidth_rad_s
    own = figures_of(base.runway_guidance, base.guidance, aircraft, bandwidth)
    assert own is not None
    cruise = min(1.3 * own.approach, aircraft.airspeed_limits.max_m_s)
    draw = Random(seed)
    ahead, across = wind.ahead * draw.random(), wind.across * draw.uniform(-1.0, 1.0)
    slowing = own.slowing_length(cruise, aircraft.gravity_m_s2)
    line = 1.1 * (_HEIGHT_M / own.slope + own.flare_length(own.slope) + slowing + _LEVEL_S * cruise)
    begin = line + _LEVEL_S * cruise
    start = {"north_m": -begin, "altitude_m": _HEIGHT_M, "airspeed_m_s": cruise}
    place = {"north_m": -line, "east_m": 0.0, "height_m": _HEIGHT_M}
    slowest = math.sqrt(own.approach**2 - across**2) - ahead
    changes: dict[str, Any] = {
        "seed": seed,
        "uavs": [{"id": 1, "name": "one", "initial": {"east_m": 0.0, **start}}],
        "network": {"leader_access": {1: 1.0}, "edges": []},
        "faults": [{"uav": 1, "start_s": _FAULT_S, **fault}] if fault else [],
        "profile": [],
        "runway": None,
        "wind": {"steady": {"north_m_s": -ahead, "east_m_s": across}, "turbulence": _TURBULENCE},
        "mission": {"items": [{"waypoint": place}, {"land": {"north_m": 0.0, "east_m": 0.0}}]},
        "duration_s": math.ceil(_TIMES * begin / slowest),
    }
    return _changed(base, changes)


def landed(
    name: str, law: str, wind: Wind, fault: dict[str, Any], seed: int
) -> TouchdownSummary | None:
    """Fly a landing; return its hardest touchdown, None if it was lost."""
    ground = fly_and_summarise(landing(name, law, wind, fault, seed)).uavs[0].ground
    whole = ground is not None and ground.outcome in {"landed", "landed hard"}
    return ground.worst if ground is not None and whole else None


def row(found: Sequence[TouchdownSummary | None]) -> list[str]:
    """Return the cells of a table."""
    whole = [one for one in found if one is not None]
    cells = [f"{len(whole)} of {len(found)}"]
    if not whole:
        return cells + ["0"] + 3 * ["-"]
    off, sink = [abs(one.east_m) for one in whole], [one.sink_m_s for one in whole]
    cells += [f"{sum(each <= NEAR_M for each in off)}", f"{max(off):.1f}"]
    cells += [f"{statistics.median(sink):.2f}, {max(sink):.2f}"]
    return [*cells, f"{max(abs(one.bank_deg) for one in whole):.1f}"]


def _changed(scenario: Scenario, changes: dict[str, Any]) -> Scenario:
    return scenario_of(Path(scenario.name), scenario.model_dump(exclude_none=True) | changes)


def _fault_of(texts: Sequence[str]) -> dict[str, Any]:
    values = (text.partition("=") for text in texts[1:])
    return {"actuator": texts[0]} | {key: float(value) for key, _, value in values} if texts else {}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.landings",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("aircraft", nargs="*", choices=[*LANDS, []], help="all unless given")
    parser.add_argument("--laws", nargs="+", choices=SIMPLEST_FIRST, default=["surviving"])
    parser.add_argument("--flights", type=int, default=20, help="of each aircraft and law")
    parser.add_argument("--seed", type=int, default=1, help="of the first flight")
    parser.add_argument("--wind", type=float, default=8.0, help="largest one from ahead [m/s]")
    parser.add_argument("--across", type=float, default=5.0, help="and across [m/s]")
    parser.add_argument("--fault", nargs="+", default=[], help="actuator, key=value ...")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    given = parser.parse_args()
    wind, seeds = Wind(given.wind, given.across), range(given.seed, given.seed + given.flights)
    head = ["aircraft", "law", "landed", "within 3 m", "farthest [m]", "sink [m/s]", "bank [deg]"]
    lines, fault = [], _fault_of(given.fault)
    with multiprocessing.get_context("spawn").Pool(given.jobs) as pool:
        for name in given.aircraft or LANDS:
            for law in given.laws:
                one = partial(landed, name, law, wind, fault)
                lines.append([name, law, *row(pool.map(one, seeds))])
    print(table(head, lines, head[2:]))


if __name__ == "__main__":
    main()

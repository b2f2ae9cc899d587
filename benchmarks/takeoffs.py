"""How three aircraft take off one after the other in wind, and land so: runway/formation.

    python -m benchmarks.takeoffs --flights 20
    python -m benchmarks.takeoffs --flights 4 --whole

Winds are drawn with the seed as for landings: up to `--wind` from ahead, up to `--across` from
either side, with light turbulence. A take-off is good if the aircraft is in the air in the end, and
was within the width of the runway up to there. Least distances are from centre to centre, on the
ground as well.
"""

import argparse
import multiprocessing
import os
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from ftc_lab.reports.markdown import table
from gcs.fleet.in_process import fly_and_summarise
from gcs.scenario.model import load_scenario, scenario_of
from sitl_plant.air.turbulence import dryden

_BASE = load_scenario("runway/formation")
_TAKEN_OFF_S = 60.0


def flown(
    ahead: float, across: float, whole: bool, seed: int
) -> tuple[list[str], list[float], float]:
    """Fly once; return what became of each aircraft, how far off it was [m], the least distance.

    Args:
        ahead: Largest wind from ahead [m/s].
        across: Largest one from either side [m/s].
        whole: Whether to standstill; else until all are in the air.
        seed: Of the wind.
    """
    draw = Random(seed)
    steady = {"north_m_s": -ahead * draw.random(), "east_m_s": across * draw.uniform(-1.0, 1.0)}
    turbulence = dryden("light", 0.0).model_dump()
    changes: dict[str, Any] = {
        "seed": seed,
        "wind": {"steady": steady, "turbulence": turbulence},
        "duration_s": _BASE.duration_s if whole else _TAKEN_OFF_S,
    }
    scenario = scenario_of(Path(_BASE.name), _BASE.model_dump(exclude_none=True) | changes)
    summary = fly_and_summarise(scenario)
    facts = [uav.ground for uav in summary.uavs]
    assert summary.separation is not None
    outcomes = ["lost" if one is None else one.outcome for one in facts]
    off = [float("inf") if one is None else one.off_centre_m or 0.0 for one in facts]
    return outcomes, off, summary.separation.least_m


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.takeoffs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--flights", type=int, default=20, help="of three aircraft")
    parser.add_argument("--seed", type=int, default=1, help="of the first flight")
    parser.add_argument("--wind", type=float, default=8.0, help="largest one from ahead [m/s]")
    parser.add_argument("--across", type=float, default=5.0, help="and across [m/s]")
    parser.add_argument("--whole", action="store_true", help="fly to standstill")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    given = parser.parse_args()
    one = partial(flown, given.wind, given.across, given.whole)
    with multiprocessing.get_context("spawn").Pool(given.jobs) as pool:
        found = pool.map(one, range(given.seed, given.seed + given.flights))
    assert _BASE.runway is not None
    good, width = "landed" if given.whole else "in the air", _BASE.runway.width_m
    each = [(a, o) for outcomes, off, _ in found for a, o in zip(outcomes, off, strict=True)]
    within = [o <= 0.5 * width for a, o in each if a == good]
    cells = [f"{len(within)} of {len(each)}", f"{sum(within)}", f"{max(o for _, o in each):.1f}"]
    head = [good, "within the width", "farthest [m]", "least distance [m]"]
    print(table(head, [[*cells, f"{min(least for *_, least in found):.1f}"]], head))


if __name__ == "__main__":
    main()

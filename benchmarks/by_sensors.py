"""Flights by sensors beside the same flights by the true state, and faults of sensors.

    python -m benchmarks.by_sensors
    python -m benchmarks.by_sensors --seeds 10 --laws tube

The first table flies scenario 1 without faults, a column for each law; the others the bundled
`sensor_faults`: how far every law is from its reference, and what the estimator makes of the fault.
Errors are of the true state, or of the estimate against it, of the worst UAV; after 10 s.
"""

import argparse
import itertools
import math
import multiprocessing
import os
import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.sensor_flights import SETTLED_S, Errors, errors_of, watched
from ftc_autopilot.control.laws import KINDS
from ftc_lab.reports.laws import LawRow, Value, law_markdown
from ftc_lab.reports.markdown import table
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.quantities import IAE_UNITS, QUANTITIES
from gcs.results.recording import Steps
from gcs.results.rivals import SIMPLEST_FIRST
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

DIAGNOSING = ("surviving", "tube")
"""Laws of which the estimator's part is printed; it is the same under all."""
FAULTS = Path(__file__).parent.parent / "scenarios" / "sensor_faults"
_MANY = 100.0  # printed without decimals


def scenario_with(name: str, law: str, seed: int, navigation: str) -> Scenario:
    """Return a scenario flown by a law, and by sensors or by the true state."""
    own = {"controller": {"kind": law}, "seed": seed, "navigation": navigation}
    return scenario_of(name, merged(scenario_tree(name), own))


def without_faults(flown: Sequence[Sequence[FlightSummary]]) -> dict[str, tuple[Value, ...]]:
    """Return what it costs a law to fly by sensors: medians by figure, before, after, and times.

    Args:
        flown: Of each seed, by the true state and by sensors.
    """
    figures: dict[str, Callable[[FlightSummary], float]] = {
        "events of all UAVs": lambda one: sum(uav.events for uav in one.uavs),
        **{
            f"IAE of {key} against the reference [{IAE_UNITS[key]}]": partial(_worst, key)
            for key in QUANTITIES
        },
    }
    return {name: _before_and_after(flown, figure) for name, figure in figures.items()}


def _before_and_after(
    pairs: Sequence[Sequence[FlightSummary]], figure: Callable[[FlightSummary], float]
) -> tuple[Value, ...]:
    counts = [
        [figure(one) if one.completed else math.inf for one in how]
        for how in zip(*pairs, strict=True)
    ]
    before, after = (statistics.median(each) for each in counts)
    times = f"{after / before:.2f}" if math.isfinite(after) else ""
    digits = 0 if figure(pairs[0][0]) > _MANY else 2
    return Value.of(before, digits), Value.of(after, digits), Value(times)


def _flown(law: str, seed: int, navigation: str) -> FlightSummary:
    tree = scenario_with("paper/scenario1", law, seed, navigation)
    scenario = tree.model_copy(update={"faults": ()})
    return summarise(fly_in_process(scenario), scenario)


def _worst(key: str, summary: FlightSummary) -> float:
    return max(uav.iae_filtered[key] or 0.0 for uav in summary.uavs)


class Faulted(NamedTuple):
    """A flight with a fault of a sensor.

    Attributes:
        noticed_s: When it was noticed, after it began; None if never.
        others: Sensors excluded before it.
        blamed: Actuators declared lost.
        errors: Of the estimate, as of `errors_of`.
        tracking: Largest error of roll or pitch, and of yaw, from the reference [deg]; infinite if
            the flight was lost.
    """

    noticed_s: float | None
    others: int
    blamed: int
    errors: Errors
    tracking: tuple[float, float]


def with_fault(name: str, law: str, seed: int) -> Faulted:
    """Fly a fault."""
    scenario = scenario_with(f"sensor_faults/{name}", law, seed, "estimated")
    flown, exclusions, *_ = watched(scenario)
    fault = scenario.faults[0]
    after = [e.time_s - fault.start_s for e in exclusions if e.excluded]
    return Faulted(
        next((time for time in after if time >= 0.0), None),
        sum(time < 0.0 for time in after),
        int((flown.signals["phase"].max(axis=(0, 1)) > 1).sum()),
        errors_of(flown, scenario.step_us),
        tracking_of(flown, scenario),
    )


def tracking_of(steps: Steps, scenario: Scenario) -> tuple[float, float]:
    """Return how far a law was from its reference, as of `Faulted`."""
    if steps.length < scenario.steps:
        return math.inf, math.inf
    first = round(SETTLED_S * 1e6 / scenario.step_us)
    off = steps.states[first:, :, 6:9] - steps.signals["reference"][first:, :, 1:]
    off = np.degrees(np.abs((off + np.pi) % (2.0 * np.pi) - np.pi))
    return float(off[..., :2].max()), float(off[..., 2].max())


def laws_with_faults(flown: Mapping[str, Mapping[str, Sequence[Faulted]]]) -> str:
    """Return the table of how far laws are from their reference, of flights by fault and law."""
    rows = []
    for name, by_law in flown.items():
        worst = {
            law: np.max([one.tracking for one in flights], axis=0)
            for law, flights in by_law.items()
        }
        cells = {law: [Value.of(float(x), 2) for x in both] for law, both in worst.items()}
        rows.append(LawRow([name], cells))
    return law_markdown(["fault"], rows, {law: law for law in rows[0].cells})


def estimator_row(name: str, law: str, flights: Sequence[Faulted]) -> list[str]:
    """Return the row of a fault and a law: when it was noticed, and the largest errors."""
    noticed = [one.noticed_s for one in flights if one.noticed_s is not None]
    when = "" if not noticed else f"{statistics.median(noticed):.2f}, {max(noticed):.2f}"
    worst = np.max([one.errors for one in flights], axis=0)
    others, blamed = (
        sum(each) for each in zip(*((f.others, f.blamed) for f in flights), strict=True)
    )
    share = f"{len(noticed)}/{len(flights)}"
    return [name, law, share, when, *(f"{value:.2f}" for value in worst), str(others), str(blamed)]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.by_sensors", description=__doc__)
    parser.add_argument("--laws", nargs="+", default=SIMPLEST_FIRST, choices=KINDS)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    columns, seeds = {law: law for law in options.laws}, range(1, options.seeds + 1)
    names = sorted(path.stem for path in FAULTS.glob("*.yaml"))
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        tasks = itertools.product(columns, seeds, ("true_state", "estimated"))
        summaries = iter(pool.starmap(_flown, tasks, chunksize=1))
        faulted = iter(pool.starmap(with_fault, itertools.product(names, columns, seeds), 1))
    costs = {
        law: without_faults([[next(summaries), next(summaries)] for _ in seeds]) for law in columns
    }
    rows = [
        LawRow([name], {law: by_name[name] for law, by_name in costs.items()})
        for name in costs[options.laws[0]]
    ]
    print(law_markdown(["by the true state, by sensors, times"], rows, columns))
    flown = {name: {law: [next(faulted) for _ in seeds] for law in columns} for name in names}
    print(laws_with_faults(flown))
    head = ["fault", "law", "excluded", "after: median, longest [s]", "roll, pitch [deg]"]
    head += ["yaw [deg]", "airspeed [m/s]", "place [m]", "excluded before", "actuators blamed"]
    print(
        table(
            head,
            [
                estimator_row(name, law, flights)
                for name, by_law in flown.items()
                for law, flights in by_law.items()
                if law in DIAGNOSING
            ],
            head[2:],
        )
    )


if __name__ == "__main__":
    main()

"""Processor time of a flight with its figures, relative to one without.

``python -m benchmarks.figures [FLIGHTS]``

Method: scenario 1 is flown in turn without figures and recording (`fly_in_steps`), with figures as
campaigns and `gcs.fly_many` take them, as a row of a campaign with everything around it, and by
`gcs.fly` with a light recording. The ratios are of the least times of a thread, so that other
programs on the machine disturb them little. Of a whole campaign it is the processor time of its
workers, two at a time, relative to as many processes that fly without figures.
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from benchmarks.campaign import flown
from ftc_lab.campaigns.flights import fly_rows
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.plan import plan, rows_of
from gcs import fly
from gcs.fleet.in_process import fly_and_summarise, fly_in_steps
from gcs.scenario.model import Scenario, load_scenario

ROUNDS = 10
WORKERS = 2
TARGET = 1.3
CAMPAIGN = {
    "name": "benchmark",
    "scenario": "paper/scenario1",
    "draws": 1,
    "factors": {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.999, "high": 1.001}}},
}


def main() -> None:
    scenario = load_scenario("paper/scenario1")
    flights = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"processor time of a flight, relative to one without figures, {ROUNDS} rounds")
    bare, *others = least_times(scenario)
    print(f"  {'without figures':45s} {1e3 * bare:6.1f} ms")
    for name, seconds in others_of(others):
        print(f"  {name:45s} {1e3 * seconds:6.1f} ms  {seconds / bare:.2f}")
    with get_context("spawn").Pool(WORKERS) as pool:
        together = sum(pool.map(bare_flights, [flights // WORKERS] * WORKERS)) / WORKERS
    ratio = flown(flights, WORKERS).flight_cpu_s / together
    print(f"  a campaign of {flights} flights, {WORKERS} workers: {ratio:.2f} (target <= {TARGET})")


def others_of(times: list[float]) -> list[tuple[str, float]]:
    names = ("with figures", "a row of a campaign", "gcs.fly, light recording")
    return list(zip(names, times, strict=True))


def least_times(scenario: Scenario) -> list[float]:
    """Return the least processor times of the ways to fly, the first without figures [s]."""
    planned = plan(Campaign.model_validate(CAMPAIGN), Path("benchmark.yaml"))
    rows = list(rows_of(planned.draws))
    ways: list[Callable[[], object]] = [
        partial(fly_in_steps, scenario, lambda _: None),
        partial(fly_and_summarise, scenario),
        partial(fly_rows, planned.flights, rows),
        partial(fly, scenario),
    ]
    return [
        min(times)
        for times in zip(*([cpu_s(way) for way in ways] for _ in range(ROUNDS)), strict=True)
    ]


def bare_flights(flights: int) -> float:
    """Fly without figures, in a process of its own; return the processor time of a flight [s]."""
    scenario = load_scenario("paper/scenario1")
    fly_in_steps(scenario, lambda _: None)  # loads the code
    begin = time.process_time()
    for _ in range(flights):
        fly_in_steps(scenario, lambda _: None)
    return (time.process_time() - begin) / flights


def cpu_s(work: Callable[[], object]) -> float:
    begin = time.thread_time()
    work()
    return time.thread_time() - begin


if __name__ == "__main__":
    main()

"""Each law's trigger beside its own slowest clock that tracks as well, by hardware and turbulence.

    python -m benchmarks.trigger_or_clock
    python -m benchmarks.trigger_or_clock --laws tube --turbulence moderate --seed 7
    python -m benchmarks.trigger_or_clock --laws tube --set controller.tube_scale=0.7

Another seed draws other gusts and noise. A clock tracks as well if no IAE of any UAV is more than
1 % above the triggered flight's.
"""

import argparse
import itertools
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from gcs.fleet.in_process import fly_in_process
from gcs.lab.baselines.baseline import Search, saved
from gcs.lab.baselines.senders import (
    FINE,
    Verdict,
    find_slowest,
    periodic_base,
    some_periods,
    worst_ratio,
)
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.scenario.settings import values_of
from mavlink_defs.config.inherit import merged, with_values
from mavlink_defs.constants import N_CHANNELS

SENDERS = (
    ("proposed", "per_channel"),
    ("surviving", "per_channel"),
    ("surviving", "scaled"),
    ("tube", "consequence"),
)
"""Laws, and triggers under them."""
HARDWARE = ("ideal", "realistic", "cheap_imu")
TURBULENCE = ("none", "light", "moderate")
LONGEST = 500
"""Control periods of the slowest clock that is flown."""
_EQUAL = 1.01
_BATCH = 4


def fly(scenario: Scenario) -> FlightSummary:
    """Fly a scenario in process."""
    return summarise(fly_in_process(scenario), scenario)


def scenario_with(
    law: str, trigger: str, hardware: str, turbulence: str, values: Mapping[str, Any] | None = None
) -> Scenario:
    """Return scenario 1 with a law and its trigger, hardware, turbulence and values by key."""
    tree = scenario_tree("paper/scenario1")
    if hardware != "ideal":
        tree = merged(tree, scenario_tree(hardware))
    own = {"controller": {"kind": law}, "trigger": {"mode": trigger}}
    tree = merged(tree, own | {"wind": {"turbulence": turbulence}})
    return scenario_of(Path(law), with_values(tree, values or {}, "--set"))


def rows(options: argparse.Namespace) -> Iterator[str]:
    """Yield the rows of the table, as they are flown."""
    with ThreadPoolExecutor(options.jobs) as pool:
        chosen = [sender for sender in SENDERS if sender[0] in options.laws]
        conditions = itertools.product(chosen, options.hardware, options.turbulence)
        values = values_of(options.set)
        if options.seed is not None:
            values["seed"] = options.seed
        for (law, trigger), hardware, turbulence in conditions:
            scenario = scenario_with(law, trigger, hardware, turbulence, values)
            cells = compare(scenario, partial(pool.map, fly))
            yield f"| {law}, {trigger} | {hardware} | {turbulence} | {' | '.join(cells)} |"


def compare(scenario: Scenario, fly_all: Any) -> list[str]:
    """Return what a trigger and the slowest equal clock of the same law send, as texts."""
    flight = fly_in_process(scenario)
    reference = summarise(flight, scenario)
    sent = sum(uav.events for uav in reference.uavs)
    messages = int((flight.signals["events"] != 0).sum())
    if worst_ratio(reference, reference) is None:
        return [str(sent), str(messages), "lost", "-", "-"]
    base = periodic_base(scenario, Path(scenario.name), {})
    search = Search(base, reference, _EQUAL, fly_all, lambda: None)
    slowest = slowest_equal(search)
    if slowest is None:
        return [str(sent), str(messages), "none", "-", "-"]
    share = saved(sent, slowest.transmissions)
    assert share is not None
    period_ms = 1e3 * slowest.sender.period_s
    count = slowest.transmissions
    return [str(sent), str(messages), f"{period_ms:.0f} ms", str(count), f"{100.0 * share:.1f} %"]


def slowest_equal(search: Search) -> Verdict | None:
    """Return the slowest clock on the list of `gcs baseline` that is equal, or None."""
    periods = some_periods(LONGEST, FINE)
    while periods:
        tried = [(periods.pop(),) * N_CHANNELS for _ in range(min(_BATCH, len(periods)))]
        found = find_slowest(search.judge(tried))
        if found is not None:
            return found
    return None


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trigger_or_clock", description=__doc__
    )
    parser.add_argument("--laws", nargs="+", default=["proposed", "surviving", "tube"])
    parser.add_argument("--hardware", nargs="+", default=HARDWARE, choices=HARDWARE)
    parser.add_argument("--turbulence", nargs="+", default=TURBULENCE, choices=TURBULENCE)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    print(
        "| law, trigger | hardware | turbulence | transmissions | messages |"
        " slowest equal clock | its transmissions | saved |"
    )
    print("| --- | --- | --- |" + " ---: |" * 5)
    for row in rows(options):
        print(row, flush=True)


if __name__ == "__main__":
    main()

"""Each law's trigger beside its own slowest clock that tracks as well, by hardware and turbulence.

    python -m benchmarks.trigger_or_clock
    python -m benchmarks.trigger_or_clock --laws tube --turbulence moderate --seed 7
    python -m benchmarks.trigger_or_clock --laws tube --set controller.tube_scale=0.7
    python -m benchmarks.trigger_or_clock --laws tube --turbulence none --seeds 12

Another seed draws other gusts and noise; with several each figure is the mean, `saved` also with
the least and the most. A clock tracks as well if no IAE of any UAV is more than 1 % above the
triggered flight's.
"""

import argparse
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

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
        seeds = [{}] if options.seed is None else [{"seed": options.seed}]
        if options.seeds is not None:
            seeds = [{"seed": seed} for seed in range(1, options.seeds + 1)]
        for sender, hardware, turbulence in conditions:
            compared = [
                compare(
                    scenario_with(*sender, hardware, turbulence, values | seed),
                    partial(pool.map, fly),
                )
                for seed in seeds
            ]
            cells = cells_of(compared)
            yield f"| {', '.join(sender)} | {hardware} | {turbulence} | {' | '.join(cells)} |"


class Compared(NamedTuple):
    """What a trigger and the slowest equal clock of the same law send."""

    transmissions: int
    messages: int
    is_lost: bool  # the triggered flight: nothing can be compared
    slowest: Verdict | None


def cells_of(compared: Sequence[Compared]) -> list[str]:
    """Return comparisons of several seeds, as texts: their means."""
    counts = [
        f"{fmean(each.transmissions for each in compared):.0f}",
        f"{fmean(each.messages for each in compared):.0f}",
    ]
    if any(each.is_lost for each in compared):
        return [*counts, "lost", "-", "-"]
    found = [(each.transmissions, each.slowest) for each in compared if each.slowest is not None]
    if len(found) < len(compared):
        return [*counts, "none", "-", "-"]
    period_ms = 1e3 * fmean(slowest.sender.period_s for _, slowest in found)
    count = fmean(slowest.transmissions for _, slowest in found)
    shares = [100.0 * (saved(sent, slowest.transmissions) or 0.0) for sent, slowest in found]
    share = f"{fmean(shares):.1f} %"
    if len(shares) > 1:
        share += f" ({min(shares):.1f} to {max(shares):.1f})"
    return [*counts, f"{period_ms:.0f} ms", f"{count:.0f}", share]


def compare(scenario: Scenario, fly_all: Any) -> Compared:
    """Fly a trigger and clocks of the same law."""
    flight = fly_in_process(scenario)
    reference = summarise(flight, scenario)
    sent = sum(uav.events for uav in reference.uavs)
    messages = int((flight.signals["events"] != 0).sum())
    if worst_ratio(reference, reference) is None:
        return Compared(sent, messages, True, None)
    base = periodic_base(scenario, Path(scenario.name), {})
    search = Search(base, reference, _EQUAL, fly_all, lambda: None)
    return Compared(sent, messages, False, slowest_equal(search))


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
    of_seed = parser.add_mutually_exclusive_group()
    of_seed.add_argument("--seed", type=int, help="of noise and gusts; the scenario's unless given")
    of_seed.add_argument("--seeds", type=int, metavar="N", help="fly seeds 1 to N, show means")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    if options.seeds is not None and options.seeds < 1:
        parser.error(f"--seeds {options.seeds}: at least 1")
    print(
        "| law, trigger | hardware | turbulence | transmissions | messages |"
        " slowest equal clock | its transmissions | saved |"
    )
    print("| --- | --- | --- |" + " ---: |" * 5)
    for row in rows(options):
        print(row, flush=True)


if __name__ == "__main__":
    main()

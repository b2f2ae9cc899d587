r"""Each law's trigger beside its own slowest clock that tracks as well, by flight and conditions.

    python -m benchmarks.trigger_or_clock
    python -m benchmarks.trigger_or_clock --laws tube --turbulence moderate --seed 7
    python -m benchmarks.trigger_or_clock --laws tube --set controller.tube_scale=0.7
    python -m benchmarks.trigger_or_clock --laws tube --turbulence none --seeds 12
    python -m benchmarks.trigger_or_clock --scenario 'profiles/*' --laws tube --hardware ideal \
        --turbulence none
    python -m benchmarks.trigger_or_clock --scenario profiles/slalom --laws tube \
        --hardware ideal --turbulence none --by-channel reference commands

Another seed draws other gusts and noise; with several each figure is the mean, `saved` also with
the least and the most. A clock tracks as well if no IAE of any UAV is more than 1 % above the
triggered flight's: against the filtered reference, which laws track, and beside it against the
commands, of which most is the reference filter's lag, the same for every sender. `--by-channel`
searches for a period for each channel as well, from there on.
"""

import argparse
import fnmatch
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from statistics import fmean, median
from typing import Any, NamedTuple

from ftc_lab.baselines.baseline import Search
from ftc_lab.baselines.senders import (
    FINE,
    YARDSTICKS,
    SenderVerdict,
    Yardstick,
    periodic_base,
    some_periods,
    worst_ratio,
)
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise
from gcs.scenario.bundled import bundled_names
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.scenario.settings import values_of
from mavlink_defs.config.inherit import merged, with_values
from mavlink_defs.constants import ACTUATORS, N_CHANNELS

SENDERS = (
    ("proposed", "per_channel"),
    ("surviving", "per_channel"),
    ("surviving", "scaled"),
    ("tube", "consequence"),
)
"""Laws, and triggers under them."""
HARDWARE = ("ideal", "realistic", "cheap_imu")
TURBULENCE = ("none", "light", "moderate")
MAX_PERIODS = 1000
"""Control periods of the slowest clock that is flown."""
_EQUAL = 1.01


def fly(scenario: Scenario) -> FlightSummary:
    """Fly a scenario in process."""
    return summarise(fly_in_process(scenario), scenario)


def scenario_with(
    law: str,
    trigger: str,
    hardware: str,
    turbulence: str,
    values: Mapping[str, Any] | None = None,
    name: str = "paper/scenario1",
) -> Scenario:
    """Return a scenario with a law and its trigger, hardware, turbulence and values by key."""
    tree = scenario_tree(name)
    if hardware != "ideal":
        tree = merged(tree, scenario_tree(hardware))
    own = {"controller": {"kind": law}, "trigger": {"mode": trigger}}
    tree = merged(tree, own | {"wind": {"turbulence": turbulence}})
    return scenario_of(Path(law), with_values(tree, values or {}, "--set"))


class Compared(NamedTuple):
    """What a trigger and the slowest equal clocks of the same law send."""

    transmissions: int
    messages: int
    is_lost: bool  # the triggered flight: nothing can be compared
    slowest: Mapping[Yardstick, SenderVerdict]  # with one period; where there is one
    by_channel: Mapping[Yardstick, SenderVerdict]  # with one for each; where searched

    def saved(self, clock: SenderVerdict) -> float:
        """Return the saving against a clock [%]."""
        return 100.0 * (1.0 - self.transmissions / clock.transmissions)


def rows(options: argparse.Namespace, found: dict[str, list[Compared]]) -> Iterator[str]:
    """Yield the rows of the table, as they are flown; `found` gets what they show, by sender."""
    with ThreadPoolExecutor(options.jobs) as pool:
        chosen = [sender for sender in SENDERS if sender[0] in options.laws]
        conditions = itertools.product(
            scenarios_of(options.scenario), chosen, options.hardware, options.turbulence
        )
        values = values_of(options.set)
        seeds = [{}] if options.seed is None else [{"seed": options.seed}]
        if options.seeds is not None:
            seeds = [{"seed": seed} for seed in range(1, options.seeds + 1)]
        for name, sender, hardware, turbulence in conditions:
            compared = [
                compare(
                    scenario_with(*sender, hardware, turbulence, values | seed, name),
                    partial(pool.map, fly),
                    options.by_channel,
                )
                for seed in seeds
            ]
            found.setdefault(", ".join(sender), []).extend(compared)
            cells = [name, ", ".join(sender), hardware, turbulence]
            cells += cells_of(compared, options.by_channel)
            yield f"| {' | '.join(cells)} |"


def scenarios_of(patterns: Sequence[str]) -> list[str]:
    """Return the bundled scenarios that patterns such as profiles/* name, and files as they are."""
    listed = []
    for pattern in patterns:
        listed += fnmatch.filter(bundled_names(), pattern) or [pattern]
    return listed


def cells_of(compared: Sequence[Compared], by_channel: Sequence[Yardstick]) -> list[str]:
    """Return comparisons of several seeds, as texts: their means."""
    cells = [
        f"{fmean(each.transmissions for each in compared):.0f}",
        f"{fmean(each.messages for each in compared):.0f}",
    ]
    for yardstick in YARDSTICKS:
        if any(each.is_lost for each in compared):
            cells += ["lost", "-", "-"]
        else:
            cells += _clock(compared, [each.slowest.get(yardstick) for each in compared])
    for yardstick in by_channel:
        cells += _clock(compared, [each.by_channel.get(yardstick) for each in compared])
    return cells


def _clock(compared: Sequence[Compared], clocks: Sequence[SenderVerdict | None]) -> list[str]:
    """Return period, transmissions and saving against the clocks of several seeds: the means."""
    found = [clock for clock in clocks if clock is not None]
    if len(found) < len(compared):
        return ["none", "-", "-"]
    periods_ms = [
        [n * clock.sender.scenario.step_us / 1e3 for n in clock.sender.periods] for clock in found
    ]
    means = [f"{fmean(periods):.0f}" for periods in zip(*periods_ms, strict=True)]
    text = means[0] if len(set(means)) == 1 else ", ".join(means)
    count = fmean(clock.transmissions for clock in found)
    shares = [each.saved(clock) for each, clock in zip(compared, found, strict=True)]
    share = f"{fmean(shares):.1f} %"
    if len(shares) > 1:
        share += f" ({min(shares):.1f} to {max(shares):.1f})"
    return [f"{text} ms", f"{count:.0f}", share]


def sentences_of(found: Mapping[str, Sequence[Compared]]) -> Iterator[str]:
    """Yield for each sender the worst, median and best of its savings over the table."""
    for sender, compared in found.items():
        for kind in ("slowest", "by_channel"):
            for yardstick in YARDSTICKS:
                clocks = [getattr(each, kind).get(yardstick) for each in compared]
                pairs = zip(compared, clocks, strict=True)
                shares = [each.saved(clock) for each, clock in pairs if clock is not None]
                if shares:
                    name = "one period" if kind == "slowest" else "a period for each channel"
                    yield (
                        f"{sender}, against {name}, errors against the {yardstick}: saved "
                        f"{min(shares):.1f} to {max(shares):.1f} %, median {median(shares):.1f} %; "
                        f"{len(shares)} of {len(compared)} flights have an equal clock"
                    )


def compare(scenario: Scenario, fly_all: Any, by_channel: Sequence[Yardstick] = ()) -> Compared:
    """Fly a trigger and clocks of the same law."""
    flight = fly_in_process(scenario)
    reference = summarise(flight, scenario)
    sent = sum(uav.events for uav in reference.uavs)
    messages = int((flight.signals["events"] != 0).sum())
    if worst_ratio(reference, reference) is None:
        return Compared(sent, messages, True, {}, {})
    base = periodic_base(scenario, Path(scenario.name), {})
    search = Search(base, reference, _EQUAL, fly_all, lambda: None)
    one_for_all = ((n,) * N_CHANNELS for n in some_periods(MAX_PERIODS, FINE))
    slowest = search.slowest_equal(one_for_all, YARDSTICKS)
    own = {
        yardstick: search.per_channel(slowest[yardstick], MAX_PERIODS, yardstick)
        for yardstick in by_channel
        if yardstick in slowest
    }
    return Compared(sent, messages, False, slowest, own)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trigger_or_clock", description=__doc__
    )
    parser.add_argument(
        "--scenario",
        nargs="+",
        default=["paper/scenario1"],
        metavar="NAME",
        help="bundled scenarios, as 'profiles/*', or files",
    )
    parser.add_argument("--laws", nargs="+", default=["proposed", "surviving", "tube"])
    parser.add_argument("--hardware", nargs="+", default=HARDWARE, choices=HARDWARE)
    parser.add_argument("--turbulence", nargs="+", default=TURBULENCE, choices=TURBULENCE)
    of_seed = parser.add_mutually_exclusive_group()
    of_seed.add_argument("--seed", type=int, help="of noise and gusts; the scenario's unless given")
    of_seed.add_argument("--seeds", type=int, metavar="N", help="fly seeds 1 to N, show means")
    parser.add_argument(
        "--by-channel",
        nargs="+",
        default=[],
        choices=YARDSTICKS,
        help="search for a period for each channel as well, errors against these",
    )
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    if options.seeds is not None and options.seeds < 1:
        parser.error(f"--seeds {options.seeds}: at least 1")
    head = ["scenario", "law, trigger", "hardware", "turbulence", "transmissions", "messages"]
    for yardstick in YARDSTICKS:
        head += [f"slowest clock equal against the {yardstick}", "its transmissions", "saved"]
    for yardstick in options.by_channel:
        names = ", ".join(ACTUATORS)
        head += [f"by channel, against the {yardstick}: {names}", "its transmissions", "saved"]
    print(f"| {' | '.join(head)} |")
    print("| --- | --- | --- | --- |" + " ---: |" * (len(head) - 4))
    found: dict[str, list[Compared]] = {}
    for row in rows(options, found):
        print(row, flush=True)
    print()
    for sentence in sentences_of(found):
        print(f"- {sentence}")


if __name__ == "__main__":
    main()

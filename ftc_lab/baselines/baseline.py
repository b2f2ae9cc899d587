"""The baselines of one triggered flight, and what its trigger saves against each.

Tracking is not monotone in the period: a slower sender may be better than a faster one. So every
period of a list is flown, and nothing is said about periods that are not on it.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ftc_lab.baselines.senders import (
    COARSE,
    FINE,
    YARDSTICKS,
    Fly,
    Sender,
    SenderVerdict,
    Yardstick,
    find_slowest,
    senders,
    some_periods,
    transmissions,
    worst_ratio,
)
from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.flights import Flights
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.plan import rows_of
from gcs.console.errors import BadInput
from gcs.results.figures import FlightSummary
from gcs.scenario.model import Scenario
from gcs.scenario.settings import plain
from mavlink_defs.config.inherit import PlaceError
from mavlink_defs.constants import N_CHANNELS

_BATCH = 4
"""Aircraft, or senders, that fly at a time; fixed, so that a result is always the same."""


@dataclass(frozen=True)
class Robustness:
    """Senders of the same uncertain aircraft.

    Attributes:
        drawn: How many aircraft.
        share: Share of them to be kept.
        largest_ratio: Largest IAE against the filtered reference of an aircraft that is kept,
            relative to the triggered flight of the nominal aircraft.
        triggered: How many the triggered sender keeps, and whether these are enough.
        checked: Periodic senders that were flown, the slowest first.
    """

    drawn: int
    share: float
    largest_ratio: float
    triggered: tuple[int, bool]
    checked: tuple[SenderVerdict, ...]

    @property
    def slowest(self) -> SenderVerdict | None:
        """The slowest periodic sender on the list that keeps enough; None if there is none."""
        return find_slowest(self.checked)

    def to_json(self) -> dict[str, Any]:
        """Return its part of `baseline.json`."""
        kept, enough = self.triggered
        return {
            "drawn": self.drawn,
            "share": self.share,
            "largest_ratio": self.largest_ratio,
            "triggered": {
                "periods": None,
                "transmissions": None,
                "kept": kept,
                "flown": self.drawn,
                "enough": enough,
                "parameters": {},
            },
            "checked": [
                _json(one, kept=one.kept, flown=one.flown, enough=one.good) for one in self.checked
            ],
        }


@dataclass(frozen=True)
class Baseline:
    """A triggered flight and periodic senders that track no worse.

    Attributes:
        scenario: Name of the triggered flight.
        law: Of the triggered flight.
        periodic_law: Of the periodic senders.
        trigger: Mode of the triggered flight.
        step_us: Control period [µs].
        largest_ratio: Largest ratio of an IAE against the filtered reference to the triggered
            flight's that counts as no worse.
        transmissions: Of the triggered flight: of single channels, all UAVs.
        every_period: The same of sending every channel in every control period.
        uniform: Every sender with one period for all channels that was flown, ascending.
        by_commands: The same senders, judged by the errors against the commands.
        per_channel: The slowest that was found with a period for each channel; None if it was
            not searched for, or if no uniform sender is as good.
        robustness: The same on uncertain aircraft; None if none were drawn.
    """

    scenario: str
    law: str
    periodic_law: str
    trigger: str
    step_us: int
    largest_ratio: float
    transmissions: int
    every_period: int
    uniform: tuple[SenderVerdict, ...]
    by_commands: tuple[SenderVerdict, ...] = ()
    per_channel: SenderVerdict | None = None
    robustness: Robustness | None = None

    @property
    def slowest_uniform(self) -> SenderVerdict | None:
        """The slowest uniform sender on the list that is no worse; None if there is none."""
        return find_slowest(reversed(self.uniform))

    @property
    def slowest_by_commands(self) -> SenderVerdict | None:
        """The same by the errors against the commands."""
        return find_slowest(reversed(self.by_commands))

    def to_json(self) -> dict[str, Any]:
        """Return the content of `baseline.json`; a saving is a share, negative if none is saved."""
        own, robustness = self.per_channel, self.robustness
        robust = robustness.slowest if robustness else None
        against = {
            "uniform": self.slowest_uniform,
            "uniform_by_commands": self.slowest_by_commands,
            "per_channel": own,
            "equal_robustness": robust,
        }
        counts = {name: one.transmissions if one else None for name, one in against.items()}
        return {
            **self.__dict__,
            "uniform": [_compared(one) for one in self.uniform],
            "by_commands": [_compared(one, "commands") for one in self.by_commands],
            "per_channel": own and _compared(own),
            "robustness": robustness and robustness.to_json(),
            "saved": {
                name: saved(self.transmissions, count)
                for name, count in {"every_period": self.every_period, **counts}.items()
            },
        }


def _compared(one: SenderVerdict, yardstick: Yardstick = "reference") -> dict[str, object]:
    """Return a sender that was compared; its `worst` is by the yardstick that `equal` is by."""
    by_commands = one.ratios.get("commands")
    worst = one.ratios.get(yardstick)
    return _json(one, worst=worst, worst_against_commands=by_commands, equal=one.good)


def _json(verdict: SenderVerdict, **found: object) -> dict[str, object]:
    return {
        "periods": verdict.sender.periods,
        "transmissions": verdict.transmissions,
        **found,
        "parameters": verdict.sender.parameters,
    }


def saved(sent: int, others: int | None) -> float | None:
    """Return the share of another sender's transmissions that were not sent; None without one."""
    return 1.0 - sent / others if others else None


@dataclass(frozen=True)
class Search:
    """What a search needs.

    Attributes:
        base: Scenario of the periodic sender.
        reference: The triggered flight.
        largest_ratio: Largest ratio of an IAE to the triggered flight's that counts as no worse.
        fly: Flies scenarios.
        on_flown: Called for each finished sender.
    """

    base: Scenario
    reference: FlightSummary
    largest_ratio: float
    fly: Fly
    on_flown: Callable[[], None]

    def flown(
        self, candidates: Iterable[tuple[int, ...]]
    ) -> Iterator[list[tuple[Sender, FlightSummary]]]:
        """Fly senders with periods by channel; for each, one flight per set of parameters."""
        listed = [senders(self.base, periods) for periods in candidates]
        flights = self.fly(one.scenario for tried in listed for one in tried)
        for tried in listed:
            flown = [(one, next(flights)) for one in tried]
            self.on_flown()
            yield flown

    def verdict(
        self, tried: Iterable[tuple[Sender, FlightSummary]], yardstick: Yardstick
    ) -> SenderVerdict:
        """Return what flights of a sender showed, of several parameters the best ones."""

        def ratio(one: tuple[Sender, FlightSummary]) -> float:
            found = worst_ratio(one[1], self.reference, yardstick)
            return math.inf if found is None else found

        best = min(tried, key=ratio)
        sender, flight = best
        return SenderVerdict(
            sender,
            sender.transmissions,
            good=ratio(best) <= self.largest_ratio,
            ratios={by: worst_ratio(flight, self.reference, by) for by in YARDSTICKS},
        )

    def slowest_equal(
        self, candidates: Iterable[tuple[int, ...]], yardsticks: Iterable[Yardstick]
    ) -> dict[Yardstick, SenderVerdict]:
        """Return by yardstick the one that transmits least of those that are no worse, if one is.

        They are flown from the slowest on, a few at a time, until there is one by each yardstick.
        """
        waiting = sorted(
            candidates, key=lambda periods: (transmissions(self.base, periods), periods)
        )
        found: dict[Yardstick, SenderVerdict] = {}
        requested = set(yardsticks)
        for first in range(0, len(waiting), _BATCH):
            flown = list(self.flown(waiting[first : first + _BATCH]))
            for yardstick in requested - found.keys():
                best = find_slowest(self.verdict(tried, yardstick) for tried in flown)
                if best is not None:
                    found[yardstick] = best
            if found.keys() == requested:
                break
        return found

    def per_channel(
        self, start: SenderVerdict, longest: int, yardstick: Yardstick = "reference"
    ) -> SenderVerdict:
        """Lengthen the periods of single channels, until no longer one on the list is as good.

        In each round the longer periods of every channel are flown, the others unchanged; of those
        that are no worse, the one that saves most is taken. The result is a local optimum: two
        channels changed at once might save more.

        Args:
            start: A sender that is no worse.
            longest: Longest period of a channel, in control periods.
            yardstick: What errors are against.
        """
        best: SenderVerdict | None = start
        while best is not None:
            start, periods = best, best.sender.periods
            longer = [
                (*periods[:i], n, *periods[i + 1 :])
                for i in range(N_CHANNELS)
                for n in some_periods(longest, COARSE, periods[i])[1:]
                if n > periods[i]
            ]
            best = self.slowest_equal(longer, [yardstick]).get(yardstick)
        return start


def find_baseline(
    scenario: Scenario, search: Search, longest: int, *, each_channel: bool
) -> Baseline:
    """Search for the slowest periodic senders that track no worse than a triggered flight.

    Args:
        scenario: Of the triggered flight.
        search: The search.
        longest: Longest period, in control periods.
        each_channel: Search for periods by channel, too.
    """
    listed = list(search.flown((n,) * N_CHANNELS for n in some_periods(longest, FINE)))
    baseline = Baseline(
        scenario=scenario.name,
        law=scenario.controller.kind,
        periodic_law=search.base.controller.kind,
        trigger=scenario.trigger.mode,
        step_us=scenario.step_us,
        largest_ratio=search.largest_ratio,
        transmissions=sum(uav.events for uav in search.reference.uavs),
        every_period=transmissions(search.base, (1,) * N_CHANNELS),
        uniform=tuple(search.verdict(tried, "reference") for tried in listed),
        by_commands=tuple(search.verdict(tried, "commands") for tried in listed),
    )
    slowest = baseline.slowest_uniform
    if slowest is None or not each_channel:
        return baseline
    return replace(baseline, per_channel=search.per_channel(slowest, longest))


@dataclass(frozen=True)
class Uncertain:
    """Aircraft that differ from the nominal one, and what is asked of a sender on them.

    Attributes:
        campaign: Draws them; its scenario and variants do not matter.
        path: Its file, for messages.
        largest_ratio: Largest IAE of an aircraft that is kept, relative to the reference.
        share: Share of the aircraft to be kept.
    """

    campaign: Campaign
    path: Path
    largest_ratio: float
    share: float

    def drawn(self, nominal: Scenario) -> list[Scenario]:
        """Return a flight by each of the aircraft.

        Raises:
            BadInput: The scenario does not have what the campaign draws.
            ConfigError: A draw makes no valid scenario.
        """
        own = self.campaign.model_copy(update={"variants": {"all": {}}})
        table = draw_table(own, [uav.id for uav in nominal.uavs])
        trees = {"all": plain(nominal.model_dump())}
        flights = Flights(own, str(self.path), trees, trees, table.schema)
        try:
            return [flights.scenario(row) for row in rows_of(table)]
        except PlaceError as problem:
            raise BadInput(
                f"the campaign {self.path} draws {problem} of this scenario",
                "name another with --campaign, whose factors the scenario has",
            ) from problem


def find_robust(
    scenario: Scenario, search: Search, uncertain: Uncertain, longest: int
) -> Robustness:
    """Search for the slowest periodic sender that keeps enough of uncertain aircraft.

    An aircraft is kept if it completes its flight and no IAE is too large. Periods are flown one
    after the other, the longest first, until one keeps enough.

    Args:
        scenario: Of the triggered flight.
        search: The search among the periodic senders of the nominal aircraft.
        uncertain: The aircraft.
        longest: Longest period, in control periods.

    Raises:
        BadInput: A scenario does not have what the campaign draws.
        ConfigError: A draw makes no valid scenario.
    """

    def fly(aircraft: list[Scenario], may_lose: int) -> tuple[int, int]:
        """Return how many are kept, and how many were flown: all, unless too many were lost."""
        kept = flown = 0
        while flown < len(aircraft) and flown - kept <= may_lose:
            for summary in search.fly(aircraft[flown : flown + _BATCH]):
                ratio = worst_ratio(summary, search.reference)
                kept += ratio is not None and ratio <= uncertain.largest_ratio
                flown += 1
        search.on_flown()
        return kept, flown

    triggered = uncertain.drawn(scenario)
    drawn = len(triggered)
    may_lose = int((1.0 - uncertain.share) * drawn + 1e-9)
    kept, _ = fly(triggered, may_lose=drawn)
    checked: list[SenderVerdict] = []
    for n in reversed(some_periods(longest, COARSE)):
        for sender in senders(search.base, (n,) * N_CHANNELS):
            if find_slowest(checked) is None:
                own, flown = fly(uncertain.drawn(sender.scenario), may_lose)
                good = drawn - own <= may_lose
                checked.append(
                    SenderVerdict(sender, sender.transmissions, good, kept=own, flown=flown)
                )
    return Robustness(
        drawn,
        uncertain.share,
        uncertain.largest_ratio,
        (kept, drawn - kept <= may_lose),
        tuple(checked),
    )

"""Search for the slowest periodic sender that tracks as well as a triggered flight.

Tracking is not monotone in the period: a slower sender may be better than a faster one. So every
period of a list is flown, and nothing is said about periods that are not on it.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

from gcs.lab.baselines.senders import own_parameters, senders, some_periods, transmissions
from gcs.results.figures import FlightSummary
from gcs.results.quantities import QUANTITIES
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS

FINE = 1.05
"""Largest ratio of neighbouring periods in the search for one period for all channels."""
COARSE = 1.25
"""The same where each channel has its own, and on uncertain aircraft."""


@dataclass(frozen=True)
class Checked:
    """A periodic sender that was flown.

    Attributes:
        periods: Control periods between transmissions, by channel as in FTC_ACTUATOR.
        transmissions: Of single channels, all UAVs.
        worst: Largest IAE by that of the triggered flight; None if it did not end well.
        equal: Whether that is within the tolerance.
        parameters: Those of its law that are not the triggered flight's; the best that were tried.
    """

    periods: tuple[int, ...]
    transmissions: int
    worst: float | None
    equal: bool
    parameters: Mapping[str, object] = field(default_factory=dict)


def worst_ratio(summary: FlightSummary, reference: FlightSummary) -> float | None:
    """Return the largest IAE of any UAV and quantity by that of a reference flight.

    None unless the flight reached its end with all attitudes and headings kept.
    """
    ratios = []
    for uav, of_reference in zip(summary.uavs, reference.uavs, strict=True):
        if uav.attitude_lost_at_s is not None or uav.heading_lost_at_s is not None:
            return None
        for quantity in QUANTITIES:
            area, allowed = uav.iae[quantity], of_reference.iae[quantity]
            if area is None or not allowed:
                return None
            ratios.append(area / allowed)
    return max(ratios) if summary.completed else None


@dataclass(frozen=True)
class Search:
    """What a search needs.

    Attributes:
        base: Scenario of the periodic sender.
        reference: The triggered flight.
        largest_ratio: Largest ratio of an IAE to the triggered flight's that counts as no worse.
        fly: Flies a scenario.
        pool: Where flights run.
        on_flown: Called with each finished sender.
    """

    base: Scenario
    reference: FlightSummary
    largest_ratio: float
    fly: Callable[[Scenario], FlightSummary]
    pool: Executor
    on_flown: Callable[[Checked], None]

    def uniform(self, periods: Sequence[int]) -> list[Checked]:
        """Fly one period for all channels, for every period of a list."""
        return self._check([(n,) * N_CHANNELS for n in periods])

    def per_channel(self, start: Checked, longest: int) -> Checked:
        """Lengthen the periods of single channels, until no longer one on the list is as good.

        In each round every longer period of every channel is flown, the others kept; of those
        that are no worse, the one that saves most is taken. The result is a local optimum: two
        channels changed at once might save more.

        Args:
            start: A sender that is no worse.
            longest: Longest period of a channel, in control periods.
        """
        best = start
        while True:
            longer = [
                (*best.periods[:i], n, *best.periods[i + 1 :])
                for i in range(N_CHANNELS)
                for n in some_periods(longest, COARSE, best.periods[i])[1:]
                if n > best.periods[i]
            ]
            equal = [one for one in self._check(longer) if one.equal]
            if not equal:
                return best
            best = min(equal, key=lambda one: (one.transmissions, one.periods))

    def _check(self, candidates: Iterable[tuple[int, ...]]) -> list[Checked]:
        listed = [(periods, senders(self.base, periods)) for periods in candidates]
        flights = self.pool.map(self.fly, [one for _, tried in listed for one in tried])
        checked = []
        for periods, tried in listed:
            best: tuple[float, Scenario] = math.inf, tried[0]
            for one in tried:
                worst = worst_ratio(next(flights), self.reference)
                if worst is not None and worst < best[0]:
                    best = worst, one
            worst = best[0] if best[0] < math.inf else None
            checked.append(
                Checked(
                    periods,
                    transmissions(self.base, periods),
                    worst,
                    equal=best[0] <= self.largest_ratio,
                    parameters=own_parameters(self.base, best[1]),
                )
            )
            self.on_flown(checked[-1])
        return checked

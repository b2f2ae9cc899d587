"""The slowest sender by the clock, of any law, that tracks as well as a law with a trigger."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from gcs.lab.baselines.combinations import ClockSender, Combination
from gcs.lab.baselines.search import COARSE, worst_ratio
from gcs.lab.baselines.senders import senders, some_periods
from gcs.results.figures import FlightSummary
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS

TOLERANCE = 1.01
"""Largest IAE by that of the triggered flight that counts as no worse."""
_SHORTEST_US, _LONGEST_US = 20_000, 500_000


@dataclass(frozen=True)
class Rival:
    """A law that sends every channel by the clock, on an aircraft.

    Attributes:
        aircraft: Key of `gcs.lab.baselines.combinations.AIRCRAFT`.
        sender: Law and period.
        scenario: What is flown.
        summary: Of the flight; None before it.
    """

    aircraft: str
    sender: ClockSender
    scenario: Scenario
    summary: FlightSummary | None = None


def rivals(listed: Iterable[Combination]) -> list[Rival]:
    """Return each law by the clock with periods of 0.02 to 0.5 s, on every aircraft.

    Args:
        listed: As of `gcs.lab.baselines.combinations.combinations`.
    """
    found = []
    for one in listed:
        if one.trigger == "periodic":
            step_us = one.scenario.step_us
            shortest, longest = (max(us // step_us, 1) for us in (_SHORTEST_US, _LONGEST_US))
            for n in some_periods(longest, COARSE, shortest):
                by_clock = ClockSender(one.law, n * step_us / 1e6)
                tried = senders(one.scenario, (n,) * N_CHANNELS)
                found += [Rival(one.aircraft, by_clock, scenario) for scenario in tried]
    return found


def fly_rivals(
    listed: Sequence[Rival], fly: Callable[[Scenario], FlightSummary], pool: Executor
) -> Iterator[Rival]:
    """Fly the senders, and yield each with its flight, in order."""
    flights = pool.map(fly, [one.scenario for one in listed])
    for one, summary in zip(listed, flights, strict=True):
        yield replace(one, summary=summary)


def with_slowest_equal(one: Combination, flown: Iterable[Rival], uav_id: int) -> Combination:
    """Return a flown combination with the sender on its aircraft that transmits least.

    Of the senders only those count that completed the flight with no IAE of any UAV more than 1 %
    above that of the combination. A combination that sends by the clock is such a sender itself.

    Args:
        one: The combination.
        flown: Senders with their flights.
        uav_id: UAV whose transmissions are compared.
    """
    best: tuple[int, ClockSender] | None = None
    own = one.uav(uav_id)
    if own is None or one.summary is None:
        return one
    if one.trigger == "periodic":
        best = own.events, ClockSender(one.law, one.scenario.step_us / 1e6)
    for rival in flown:
        if rival.aircraft != one.aircraft or rival.summary is None:
            continue
        ratio, uav = worst_ratio(rival.summary, one.summary), rival.summary.uav(uav_id)
        if uav is None or ratio is None or ratio > TOLERANCE:
            continue
        if best is None or uav.events < best[0]:
            best = (uav.events, rival.sender)
    if best is None:
        return one
    return replace(one, slowest_equal=replace(best[1], transmissions=best[0]))

"""Uncertain aircraft: the draws of a campaign, flown by one sender."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path

from gcs.errors import BadInput
from gcs.lab.baselines.search import worst_ratio
from gcs.lab.baselines.senders import own_parameters, senders, transmissions
from gcs.lab.campaigns.draws import draw_table
from gcs.lab.campaigns.flights import Flights, Row
from gcs.lab.campaigns.mark import plain
from gcs.lab.campaigns.model import Campaign
from gcs.lab.campaigns.plan import rows_of
from gcs.results.figures import FlightSummary
from gcs.scenario.model import Scenario
from mavlink_defs.config.inherit import PlaceError
from mavlink_defs.constants import N_CHANNELS

_BATCH = 4
"""Aircraft that fly before a sender is given up; fixed, so that a result is always the same."""


@dataclass(frozen=True)
class Kept:
    """How many aircraft a sender keeps.

    Attributes:
        periods: Control periods between transmissions, by channel as in FTC_ACTUATOR; None of a
            triggered sender.
        transmissions: Of single channels in one flight, all UAVs; None of a triggered sender.
        kept: Aircraft that were kept.
        flown: Aircraft that were flown; fewer than drawn if too many were lost already.
        enough: Whether the share that was asked for was kept, of all.
        parameters: Those of its law that are not the triggered flight's.
    """

    periods: tuple[int, ...] | None
    transmissions: int | None
    kept: int
    flown: int
    enough: bool
    parameters: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Aircraft:
    """Drawn aircraft, and what it means to keep them.

    Attributes:
        flights: From draws to scenarios.
        rows: The draws.
        reference: The triggered flight of the nominal aircraft.
        largest_ratio: An aircraft is kept if it completes its flight and no IAE is larger than
            this many times that of the reference.
        share: Share of the aircraft to be kept.
    """

    flights: Flights
    rows: Sequence[Row]
    reference: FlightSummary
    largest_ratio: float
    share: float

    def kept_by(
        self,
        scenario: Scenario,
        fly: Callable[[Scenario], FlightSummary],
        pool: Executor,
        *,
        to_the_end: bool,
    ) -> Kept:
        """Fly the aircraft with one scenario's law and sender.

        Args:
            scenario: The scenario of the nominal aircraft.
            fly: Flies a scenario.
            pool: Where flights run.
            to_the_end: Go on when too many are lost already.
        """
        trees = dict.fromkeys(self.flights.trees, plain(scenario.model_dump()))
        flights = replace(self.flights, trees=trees, filled=trees)
        allowed = self._allowed
        kept = flown = 0
        for begin in range(0, len(self.rows), _BATCH):
            batch = [flights.scenario(row) for row in self.rows[begin : begin + _BATCH]]
            for summary in pool.map(fly, batch):
                ratio = worst_ratio(summary, self.reference)
                kept += ratio is not None and ratio <= self.largest_ratio
                flown += 1
            if flown - kept > allowed and not to_the_end:
                break
        return Kept(None, None, kept, flown, len(self.rows) - kept <= allowed)

    def slowest(
        self,
        base: Scenario,
        periods: Sequence[int],
        fly: Callable[[Scenario], FlightSummary],
        pool: Executor,
        on_flown: Callable[[Kept], None],
    ) -> list[Kept]:
        """Fly one period after the other, the longest first, until one keeps enough.

        Args:
            base: Scenario of the periodic sender.
            periods: The list of periods, in control periods, ascending.
            fly: Flies a scenario.
            pool: Where flights run.
            on_flown: Called with each finished sender.
        """
        found: list[Kept] = []
        for n in reversed(periods):
            own = (n,) * N_CHANNELS
            for one in senders(base, own):
                result = self.kept_by(one, fly, pool, to_the_end=False)
                sent, parameters = transmissions(base, own), own_parameters(base, one)
                found.append(
                    replace(result, periods=own, transmissions=sent, parameters=parameters)
                )
                on_flown(found[-1])
                if result.enough:
                    return found
        return found

    @property
    def _allowed(self) -> int:
        return int((1.0 - self.share) * len(self.rows) + 1e-9)


def drawn_aircraft(
    campaign: Campaign,
    path: Path,
    draws: int,
    scenario: Scenario,
    reference: FlightSummary,
    largest_ratio: float,
    share: float,
) -> Aircraft:
    """Draw aircraft as a campaign does, for a scenario of one's own.

    Args:
        campaign: The campaign; its scenario and variants do not matter.
        path: Its file, for messages.
        draws: How many aircraft.
        scenario: The scenario.
        reference: As of `Aircraft`, like the rest.
        largest_ratio: See there.
        share: See there.

    Raises:
        BadInput: The scenario does not have what the campaign draws.
        ConfigError: A draw makes no valid scenario.
    """
    own = campaign.model_copy(update={"draws": draws, "variants": {"all": {}}})
    table = draw_table(own, [uav.id for uav in scenario.uavs])
    trees = {"all": plain(scenario.model_dump())}
    flights = Flights(own, str(path), trees, trees, table.schema)
    rows = list(rows_of(table))
    try:
        for row in rows:
            flights.scenario(row)
    except PlaceError as problem:
        raise BadInput(
            f"the campaign {path} draws {problem} of this scenario",
            "name another with --campaign, whose factors the scenario has",
        ) from problem
    return Aircraft(flights, rows, reference, largest_ratio, share)

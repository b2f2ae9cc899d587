"""The baselines of one triggered flight, and what its trigger saves against each."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

from gcs.lab.baselines.aircraft import Aircraft, Kept
from gcs.lab.baselines.search import COARSE, FINE, Checked, Search
from gcs.lab.baselines.senders import some_periods, transmissions
from gcs.results.figures import FlightSummary
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS


@dataclass(frozen=True)
class Robustness:
    """Senders of the same uncertain aircraft.

    Attributes:
        drawn: How many aircraft.
        share: Share of them to be kept.
        largest_ratio: Largest IAE of an aircraft that is kept, by that of the triggered flight
            of the nominal aircraft.
        triggered: How many the triggered sender keeps.
        checked: Periodic senders that were flown, the slowest first.
    """

    drawn: int
    share: float
    largest_ratio: float
    triggered: Kept
    checked: tuple[Kept, ...]

    @property
    def slowest(self) -> Kept | None:
        """The slowest periodic sender on the list that keeps enough; None if there is none."""
        return next((one for one in self.checked if one.enough), None)


@dataclass(frozen=True)
class Baseline:
    """A triggered flight and periodic senders that track no worse.

    Attributes:
        scenario: Name of the triggered flight.
        law: Of the triggered flight.
        periodic_law: Of the periodic senders.
        trigger: Mode of the triggered flight.
        step_us: Control period [µs].
        largest_ratio: Largest ratio of an IAE to the triggered flight's that counts as no worse.
        transmissions: Of the triggered flight: of single channels, all UAVs.
        every_period: The same of sending every channel in every control period.
        uniform: Every sender with one period for all channels that was flown, ascending.
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
    uniform: tuple[Checked, ...]
    per_channel: Checked | None = None
    robustness: Robustness | None = None

    @property
    def slowest_uniform(self) -> Checked | None:
        """The slowest uniform sender on the list that is no worse; None if there is none."""
        return next((one for one in reversed(self.uniform) if one.equal), None)

    def to_json(self) -> dict[str, Any]:
        """Return the content of `baseline.json`; a saving is a share, negative if none is saved."""
        uniform, own = self.slowest_uniform, self.per_channel
        robust = self.robustness.slowest if self.robustness else None
        against = {
            "every_period": self.every_period,
            "uniform": uniform.transmissions if uniform else None,
            "per_channel": own.transmissions if own else None,
            "equal_robustness": robust.transmissions if robust else None,
        }
        return {
            **asdict(self),
            "saved": {name: saved(self.transmissions, count) for name, count in against.items()},
        }


def saved(sent: int, others: int | None) -> float | None:
    """Return the share of another sender's transmissions that were not sent; None without one."""
    return 1.0 - sent / others if others else None


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
    periods = some_periods(longest, FINE)
    baseline = Baseline(
        scenario=scenario.name,
        law=scenario.controller.kind,
        periodic_law=search.base.controller.kind,
        trigger=scenario.trigger.mode,
        step_us=scenario.step_us,
        largest_ratio=search.largest_ratio,
        transmissions=sum(uav.events for uav in search.reference.uavs),
        every_period=transmissions(search.base, (1,) * N_CHANNELS),
        uniform=tuple(search.uniform(periods)),
    )
    slowest = baseline.slowest_uniform
    if slowest is None or not each_channel:
        return baseline
    return replace(baseline, per_channel=search.per_channel(slowest, longest))


def find_robust(
    scenario: Scenario,
    base: Scenario,
    aircraft: Aircraft,
    longest: int,
    fly: Callable[[Scenario], FlightSummary],
    pool: Executor,
    on_flown: Callable[[Kept], None],
) -> Robustness:
    """Search for the slowest periodic sender that keeps enough of the uncertain aircraft.

    Args:
        scenario: Of the triggered flight.
        base: Scenario of the periodic senders.
        aircraft: The aircraft.
        longest: Longest period, in control periods.
        fly: Flies a scenario.
        pool: Where flights run.
        on_flown: Called with each finished sender.
    """
    triggered = aircraft.kept_by(scenario, fly, pool, to_the_end=True)
    on_flown(triggered)
    checked = aircraft.slowest(base, some_periods(longest, COARSE), fly, pool, on_flown)
    return Robustness(
        len(aircraft.rows), aircraft.share, aircraft.largest_ratio, triggered, tuple(checked)
    )

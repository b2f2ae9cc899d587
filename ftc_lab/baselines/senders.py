"""Senders by the clock, what flights of them show, and the slowest that is good enough."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.periodic import Periodic
from gcs.console.errors import BadInput
from gcs.results.figures import FlightSummary, UavSummary
from gcs.results.quantities import QUANTITIES
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.config.inherit import PlaceError, with_values
from mavlink_defs.constants import ACTUATORS

FINE = 1.05
"""Largest ratio of neighbouring periods in the search for one period for all channels."""
COARSE = 1.25
"""The same where each channel has its own, on uncertain aircraft, and among rivals."""

Fly: TypeAlias = Callable[[Iterable[Scenario]], Iterator[FlightSummary]]
"""Flies scenarios, several at a time, and returns their summaries in order."""


Yardstick: TypeAlias = Literal["reference", "commands"]
"""What errors are against: the filtered reference, which laws track, or the commands, which step.

An IAE against the commands is mostly the reference filter's lag, which no sender can change."""
YARDSTICKS: tuple[Yardstick, ...] = ("reference", "commands")


@dataclass(frozen=True)
class Sender:
    """A law that sends by the clock.

    Attributes:
        periods: Control periods between transmissions, by channel as in FTC_ACTUATOR.
        scenario: What is flown.
        parameters: Parameters of its law that its base does not have.
    """

    periods: tuple[int, ...]
    scenario: Scenario
    parameters: Mapping[str, object]

    @property
    def law(self) -> str:
        """Kind of its law."""
        return self.scenario.controller.kind

    @property
    def period_s(self) -> float:
        """Its shortest period [s]."""
        return min(self.periods) * self.scenario.step_us / 1e6

    @property
    def transmissions(self) -> int:
        """Transmissions of single channels that a whole flight takes, of all UAVs."""
        return transmissions(self.scenario, self.periods)


@dataclass(frozen=True)
class SenderVerdict:
    """What flights of a sender showed.

    Attributes:
        sender: The sender; of several parameters of its law the best ones.
        transmissions: Those that are compared.
        good: Whether it is as good as asked for.
        ratios: Largest IAE relative to the triggered flight, by yardstick; None if it did not end
            well.
        kept: Aircraft that were kept.
        flown: Aircraft that were flown; fewer than drawn if too many were lost already.
    """

    sender: Sender
    transmissions: int
    good: bool
    ratios: Mapping[Yardstick, float | None] = field(default_factory=dict)
    kept: int = 0
    flown: int = 1


def find_slowest(verdicts: Iterable[SenderVerdict]) -> SenderVerdict | None:
    """Return the good one that transmits least, of equal ones the first; None if none is good."""
    good = (verdict for verdict in verdicts if verdict.good)
    return min(good, key=lambda verdict: verdict.transmissions, default=None)


def worst_ratio(
    summary: FlightSummary, triggered: FlightSummary, yardstick: Yardstick = "reference"
) -> float | None:
    """Return the largest IAE of any UAV and quantity relative to a triggered flight's.

    None unless the flight reached its end with all attitudes and headings kept.

    Args:
        summary: The flight.
        triggered: The flight that it is compared with.
        yardstick: What the errors are against.
    """
    if summary.departure or not summary.completed:
        return None
    ratios = []
    for uav, of_triggered in zip(summary.uavs, triggered.uavs, strict=True):
        for quantity in QUANTITIES:
            area, allowed = (_iae(one, yardstick)[quantity] for one in (uav, of_triggered))
            if area is None or not allowed:
                return None
            ratios.append(area / allowed)
    return max(ratios)


def _iae(uav: UavSummary, yardstick: Yardstick) -> Mapping[str, float | None]:
    return uav.iae_filtered if yardstick == "reference" else uav.iae


def periodic_base(scenario: Scenario, path: Path, against: Mapping[str, object]) -> Scenario:
    """Return the scenario with a periodic sender, which transmits in every control period.

    Args:
        scenario: The triggered flight.
        path: Its file, for messages.
        against: Keys of the scenario that the periodic sender has otherwise, such as its law.

    Raises:
        BadInput: A key does not exist.
        ConfigError: The result is no valid scenario.
    """
    tree = scenario.model_dump()
    thresholds = {key: tree["trigger"][key] for key in TriggerParameters.model_fields}
    tree["trigger"] = {**thresholds, "mode": "periodic"}
    try:
        return scenario_of(path, with_values(tree, against, "--against"))
    except PlaceError as problem:
        raise BadInput(f"--against {problem}") from problem


def senders(base: Scenario, periods: tuple[int, ...]) -> list[Sender]:
    """Return senders with these periods, one for each set of parameters that the law tries.

    Args:
        base: A scenario of `periodic_base`.
        periods: Control periods from one transmission to the next, by channel as in FTC_ACTUATOR.
    """
    seconds = {
        f"{name}_period_s": n * base.step_us / 1e6
        for name, n in zip(ACTUATORS, periods, strict=True)
    }
    trigger = Periodic.model_validate(base.trigger.model_dump() | seconds)
    of_base, found = base.controller.model_dump(), []
    for law in base.controller.by_clock():
        own = {k: v for k, v in law.model_dump().items() if v != of_base[k]}
        scenario = base.model_copy(update={"trigger": trigger, "controller": law})
        found.append(Sender(periods, scenario, own))
    return found


def transmissions(base: Scenario, periods: Sequence[int]) -> int:
    """Return how many transmissions of single channels a whole flight takes, of all UAVs."""
    return len(base.uavs) * sum(math.ceil(base.steps / n) for n in periods)


def some_periods(longest: int, ratio: float, shortest: int = 1) -> list[int]:
    """Return periods in ascending order, each at most `ratio` times the one before it, or one more.

    Args:
        longest: The last one, in control periods.
        ratio: Above 1.
        shortest: The first one.
    """
    found, n = [], shortest
    while n < longest:
        found.append(n)
        n = max(n + 1, math.floor(n * ratio))
    return [*found, longest]

"""Every law with every trigger, on an ideal and on a realistic aircraft."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.control.triggers.base import TriggerParameters
from gcs.results.figures import FlightSummary, UavSummary
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.framing import codec

AIRCRAFT = {"ideal": (), "realistic": ("realistic",)}
"""Aircraft by name, with the bundled additions that make them."""


@dataclass(frozen=True)
class Survival:
    """Fault files that a combination flew.

    Attributes:
        flown: How many.
        lost: Those whose aircraft left controlled flight, by name of the file: the flight ended
            early, or roll or pitch was more than 90° off.
    """

    flown: int
    lost: tuple[str, ...]


@dataclass(frozen=True)
class ClockSender:
    """A law that sends every channel by the clock.

    Attributes:
        law: Kind of law.
        period_s: Of every channel [s].
        transmissions: Of single channels, of the UAV that is compared; 0 before the flight.
    """

    law: str
    period_s: float
    transmissions: int = 0


@dataclass(frozen=True)
class Combination:
    """A law with a trigger on an aircraft.

    Attributes:
        aircraft: Key of `AIRCRAFT`.
        law: Kind of law.
        trigger: Mode of the trigger.
        scenario: What is flown.
        summary: Of the flight; None before it.
        survival: On the fault files; None if they were not flown.
        slowest_equal: What transmits least of the senders by the clock that track no worse; None
            if none does, or none was flown.
    """

    aircraft: str
    law: str
    trigger: str
    scenario: Scenario
    summary: FlightSummary | None = None
    survival: Survival | None = None
    slowest_equal: ClockSender | None = None

    def uav(self, uav_id: int) -> UavSummary | None:
        """Return a UAV's part of the flight; None unless all attitudes and headings were kept."""
        if self.summary is None or not self.summary.completed or _departed(self.summary):
            return None
        return self.summary.uav(uav_id)


def _departed(summary: FlightSummary, *, heading: bool = True) -> bool:
    return any(
        uav.attitude_lost_at_s is not None or (heading and uav.heading_lost_at_s is not None)
        for uav in summary.uavs
    )


def combinations(scenario: Scenario) -> list[Combination]:
    """Return every law with every trigger that it can have, on every aircraft.

    Args:
        scenario: The flight. Its own law keeps its parameters, the others have their defaults;
            thresholds are those of the scenario.
    """
    found = []
    for aircraft in AIRCRAFT:
        tree = _with_aircraft(scenario.model_dump(), aircraft)
        for law, model in LAWS.items():
            for mode in filter(model.goes_with, MODES):
                found.append(Combination(aircraft, law, mode, _scenario(tree, law, mode)))
    return found


def _with_aircraft(tree: dict[str, Any], aircraft: str) -> dict[str, Any]:
    for addition in AIRCRAFT[aircraft]:
        tree = merged(tree, scenario_tree(addition))
    return tree


def _scenario(tree: dict[str, Any], law: str, mode: str) -> Scenario:
    thresholds = {key: tree["trigger"][key] for key in TriggerParameters.model_fields}
    controller = merged(tree["controller"], {"kind": law})
    name = f"{tree['name']}, law {law}, trigger {mode}"
    changes = {"name": name, "controller": controller, "trigger": {**thresholds, "mode": mode}}
    return scenario_of(name, {**tree, **changes})


def fly_all(
    listed: Iterable[Combination], fly: Callable[[Scenario], FlightSummary], pool: Executor
) -> Iterator[Combination]:
    """Fly combinations, and yield each with its flight, in order.

    Args:
        listed: The combinations.
        fly: Flies a scenario.
        pool: Where flights run.
    """
    planned = list(listed)
    flights = pool.map(fly, [one.scenario for one in planned])
    for one, summary in zip(planned, flights, strict=True):
        yield replace(one, summary=summary)


def fault_files() -> list[str]:
    """Return the names of the bundled fault files."""
    return sorted(path.stem for path in (SCENARIOS / "faults").glob("*.yaml"))


def fly_faults(
    one: Combination, fly: Callable[[Scenario], FlightSummary], pool: Executor
) -> Combination:
    """Fly a combination on every fault file, and return it with what it survived."""
    files = fault_files()
    scenarios = []
    for file in files:
        tree = scenario_of(file, scenario_tree(f"faults/{file}")).model_dump()
        scenarios.append(_scenario(_with_aircraft(tree, one.aircraft), one.law, one.trigger))
    summaries = pool.map(fly, scenarios)
    lost = [
        file
        for file, summary in zip(files, summaries, strict=True)
        if not summary.completed or _departed(summary, heading=False)
    ]
    return replace(one, survival=Survival(len(files), tuple(lost)))


def message_bytes() -> int:
    """Return the length of an unsigned actuator message with four commands that are not 0."""
    payload = np.zeros(1, codec.ACTUATORS)
    payload["controls"][:, :N_CHANNELS] = 1.0
    return codec.pack(codec.new_buffer(), payload, codec.MessageId.ACTUATORS, 1, 1, 0)


def on_the_front(points: dict[str, tuple[float, float]]) -> list[str]:
    """Return the names of points that no other is as small as in both numbers, by the first.

    Of equal points each is on the front.
    """
    return sorted(
        (
            name
            for name, (x, y) in points.items()
            if not any(a <= x and b <= y and (a, b) != (x, y) for a, b in points.values())
        ),
        key=lambda name: points[name],
    )

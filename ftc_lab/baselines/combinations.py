"""Every law with every trigger, on an ideal and on a realistic aircraft, and their rivals."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_lab.baselines.senders import (
    COARSE,
    Fly,
    Sender,
    SenderVerdict,
    find_slowest,
    senders,
    some_periods,
    worst_ratio,
)
from gcs.results.figures import FlightSummary, UavSummary
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.framing import codec

AIRCRAFT = {"ideal": (), "realistic": ("realistic",)}
"""Aircraft by name, with the bundled additions that make them."""
TOLERANCE = 1.01
"""Largest IAE, relative to the triggered flight, that counts as no worse."""
_MIN_PERIOD_US, _MAX_PERIOD_US = 5_000, 500_000  # periods of rivals


@dataclass(frozen=True)
class Combination:
    """A law with a trigger on an aircraft.

    Attributes:
        aircraft: Key of `AIRCRAFT`.
        law: Kind of law.
        trigger: Mode of the trigger.
        scenario: What is flown.
        summary: Of the flight; None before it.
        faults_lost: Fault files on which its aircraft left controlled flight: the flight ended
            early, or roll or pitch was more than 90° off. None if they were not flown.
        slowest_equal: What transmits least of the senders by the clock that track no worse, with
            the transmissions of one UAV; None if none does, or none was flown.
    """

    aircraft: str
    law: str
    trigger: str
    scenario: Scenario
    summary: FlightSummary | None = None
    faults_lost: tuple[str, ...] | None = None
    slowest_equal: SenderVerdict | None = None

    def uav(self, uav_id: int) -> UavSummary | None:
        """Return a UAV's part of the flight; None unless all attitudes and headings were kept."""
        if self.summary is None or not self.summary.completed or self.summary.departure:
            return None
        return self.summary.uav(uav_id)


def combinations(scenario: Scenario) -> list[Combination]:
    """Return every law with every trigger that it can have, on every aircraft.

    Args:
        scenario: The flight. Its own law keeps its parameters, the others have their defaults;
            all have the scenario's thresholds.
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


def fault_files() -> list[str]:
    """Return the names of the bundled fault files."""
    return sorted(path.stem for path in (SCENARIOS / "faults").glob("*.yaml"))


def fly_faults(one: Combination, fly: Fly) -> Combination:
    """Fly a combination on every fault file, and return it with those that it did not survive."""
    files = fault_files()
    scenarios = []
    for file in files:
        tree = scenario_of(file, scenario_tree(f"faults/{file}")).model_dump()
        scenarios.append(_scenario(_with_aircraft(tree, one.aircraft), one.law, one.trigger))
    lost = [
        file
        for file, summary in zip(files, fly(scenarios), strict=True)
        if not summary.completed or any(uav.attitude_lost_at_s is not None for uav in summary.uavs)
    ]
    return replace(one, faults_lost=tuple(lost))


def rivals(listed: Iterable[Combination]) -> list[tuple[str, Sender]]:
    """Return each law by the clock with periods of 0.005 to 0.5 s, on every aircraft.

    Args:
        listed: As of `combinations`.

    Returns:
        Aircraft and sender.
    """
    found = []
    for one in listed:
        if one.trigger == "periodic":
            step_us = one.scenario.step_us
            shortest, longest = (max(us // step_us, 1) for us in (_MIN_PERIOD_US, _MAX_PERIOD_US))
            for n in some_periods(longest, COARSE, shortest):
                found += [(one.aircraft, s) for s in senders(one.scenario, (n,) * N_CHANNELS)]
    return found


def with_slowest_equal(
    one: Combination, flown: Iterable[tuple[str, Sender, FlightSummary]], uav_id: int
) -> Combination:
    """Return a flown combination with the sender on its aircraft that transmits least.

    Of the senders only those count that completed the flight with no IAE of any UAV more than 1 %
    above the combination's. A combination that sends by the clock is such a sender itself.

    Args:
        one: The combination.
        flown: What `rivals` returned, with their flights.
        uav_id: UAV whose transmissions are compared.
    """
    own, reference = one.uav(uav_id), one.summary
    if own is None or reference is None:
        return one
    verdicts = []
    if one.trigger == "periodic":
        itself = Sender((1,) * N_CHANNELS, one.scenario, {})
        verdicts.append(SenderVerdict(itself, own.events, good=True))
    for aircraft, sender, summary in flown:
        uav, ratio = summary.uav(uav_id), worst_ratio(summary, reference)
        if aircraft == one.aircraft and uav is not None:
            good = ratio is not None and ratio <= TOLERANCE
            verdicts.append(SenderVerdict(sender, uav.events, good))
    return replace(one, slowest_equal=find_slowest(verdicts))


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

"""Periodic senders to compare a triggered flight with."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.periodic import Periodic
from gcs.errors import BadInput
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.config.inherit import PlaceError, with_values
from mavlink_defs.constants import ACTUATORS

__all__ = ["periodic_base", "sender", "some_periods", "transmissions"]


def periodic_base(scenario: Scenario, path: Path, against: Mapping[str, object]) -> Scenario:
    """Return the scenario with a periodic sender, which transmits in every control period.

    Args:
        scenario: The triggered flight.
        path: Its file, for messages.
        against: Keys of the scenario that the periodic sender has otherwise, such as its law.

    Raises:
        BadInput: A key does not exist, or the law has no periodic sender.
        ConfigError: The result is no valid scenario.
    """
    tree = scenario.model_dump()
    kept = {key: tree["trigger"][key] for key in TriggerParameters.model_fields}
    tree["trigger"] = {**kept, "mode": "periodic"}
    if scenario.controller.CHOOSES and not any(key.startswith("controller") for key in against):
        raise BadInput(
            f"the law {scenario.controller.kind!r} chooses what it sends: it has no periodic "
            "sender to compare with",
            "name the law of the periodic sender, as in --against controller.kind=surviving",
        )
    try:
        return scenario_of(path, with_values(tree, against))
    except PlaceError as problem:
        raise BadInput(f"--against {problem}") from problem


def sender(base: Scenario, periods: Sequence[int]) -> Scenario:
    """Return a scenario of `periodic_base` with other periods.

    Args:
        base: The scenario.
        periods: Control periods from one transmission to the next, by channel as in FTC_ACTUATOR.
    """
    seconds = {
        f"{name}_period_s": n * base.step_us / 1e6
        for name, n in zip(ACTUATORS, periods, strict=True)
    }
    trigger = Periodic.model_validate(base.trigger.model_dump() | seconds)
    return base.model_copy(update={"trigger": trigger})


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

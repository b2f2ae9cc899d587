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
    kept = {key: tree["trigger"][key] for key in TriggerParameters.model_fields}
    tree["trigger"] = {**kept, "mode": "periodic"}
    try:
        return scenario_of(path, with_values(tree, against, "--against"))
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


def senders(base: Scenario, periods: Sequence[int]) -> list[Scenario]:
    """Return what `sender` does, once for each set of parameters that its law tries by the clock.

    Args:
        base: As of `sender`.
        periods: As of `sender`.
    """
    one = sender(base, periods)
    return [one.model_copy(update={"controller": law}) for law in one.controller.by_clock()]


def own_parameters(base: Scenario, one: Scenario) -> dict[str, object]:
    """Return the law's parameters that a scenario of `senders` does not share with its base."""
    of_base = base.controller.model_dump()
    return {k: v for k, v in one.controller.model_dump().items() if v != of_base[k]}


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

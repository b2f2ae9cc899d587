"""A scenario with changes: additions merged into it, and keys set."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from ftc_autopilot.plugins.loading import label as short_name
from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from gcs.scenario.plugins import is_unread
from gcs.scenario.settings import label, plain
from mavlink_defs.config.inherit import PlaceError, joined, merged, with_values

ScenarioLike: TypeAlias = Scenario | Path | str
"""A scenario, a file, or the name of a bundled one."""


def with_changes(
    scenario: ScenarioLike,
    additions: Sequence[Path | str] = (),
    values: Mapping[str, Any] = MappingProxyType({}),
    source: str = "changes",
) -> Scenario:
    """Return a scenario with additions merged into it, and keys set.

    The name of the flight says what was changed.

    Args:
        scenario: A file, the name of a bundled scenario, or one that was read.
        additions: Files or bundled additions, each merged into the ones before it.
        values: Data by key, as in ``trigger.b2_deg``, ``faults[0].uav`` or ``controller``;
            a mapping is merged into what is there, None removes it.
        source: Where the keys are written, for messages, such as "--set".

    Raises:
        BadInput: An argument is of another type; a key does not exist, or is not written as one.
        ConfigError: A file cannot be used, or the result is no valid scenario.
    """
    _check_types(scenario, additions, values, source)
    try:
        values = plain(values)
        labels = [f"{key} = {short_name(label(value))}" for key, value in values.items()]
    except TypeError as problem:
        raise BadInput(f"{source}: expected plain data: {problem}") from None
    if not additions and not values and not isinstance(scenario, Scenario):
        return load_scenario(scenario)
    if isinstance(scenario, Scenario) and not additions and not values and not is_unread(scenario):
        return scenario
    if isinstance(scenario, Scenario):
        origin, tree = scenario.name, plain(scenario.model_dump(exclude_unset=True))
    else:
        origin, tree = str(scenario), scenario_tree(scenario)
    for name in additions:
        tree = joined(tree, scenario_tree(name))
    try:
        tree = with_values(tree, values, source)
    except PlaceError as problem:
        raise BadInput(f"{source} {problem}") from problem
    if "name" in tree and "name" not in values:
        added = [f"with {name}" for name in additions]
        tree = merged(tree, {"name": ", ".join([str(tree["name"]), *added, *labels])})
    return scenario_of(origin, tree)


def _check_types(scenario: object, additions: object, values: object, source: str) -> None:
    """Refuse what a caller in Python may have mixed up."""
    if not isinstance(scenario, Scenario | Path | str):
        kind = type(scenario).__name__
        raise BadInput(f"scenario: expected a name, a path or a Scenario, got {kind}")
    if isinstance(additions, str | Path):
        raise BadInput(f"overlays: expected a list, as in [{str(additions)!r}]")
    if not isinstance(values, Mapping):
        kind = type(values).__name__
        raise BadInput(
            f"{source}: expected a mapping, got {kind}", "as in {'controller.kind': 'surviving'}"
        )
    for key, value in values.items():
        if callable(value):
            name = getattr(value, "__name__", type(value).__name__)
            raise BadInput(
                f"{source}: {key} is {name}, an object of Python; expected plain data",
                f"name its file and class in a text: 'FILE.py:{name}'",
            )

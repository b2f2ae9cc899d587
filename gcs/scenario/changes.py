"""A scenario with changes: additions merged into it, and keys set."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ftc_autopilot.plugins.loading import label as short_name
from gcs.errors import BadInput
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from gcs.scenario.plugins import is_unread
from gcs.scenario.settings import label, plain
from mavlink_defs.config.inherit import PlaceError, merged, with_values


def with_changes(
    scenario: Scenario | Path | str,
    additions: Sequence[Path | str],
    values: Mapping[str, Any],
    source: str,
) -> Scenario:
    """Return a scenario with additions merged into it, and keys set.

    The name of the flight says what was changed.

    Args:
        scenario: A file, the name of a bundled scenario, or one that was read.
        additions: Files or bundled additions, each merged into the ones before it.
        values: Plain data by key, as in ``trigger.b2_deg``, ``faults[0].uav`` or ``controller``;
            a mapping is merged into what is there, None removes it.
        source: Where the keys are written, for messages, such as "--set".

    Raises:
        BadInput: A key does not exist, or is not written as one.
        ConfigError: A file cannot be used, or the result is no valid scenario.
    """
    if not additions and not values and not isinstance(scenario, Scenario):
        return load_scenario(scenario)
    if isinstance(scenario, Scenario) and not additions and not values and not is_unread(scenario):
        return scenario
    if isinstance(scenario, Scenario):
        origin, tree = scenario.name, plain(scenario.model_dump(exclude_unset=True))
    else:
        origin, tree = str(scenario), scenario_tree(scenario)
    changes = [f"with {name}" for name in additions]
    for name in additions:
        tree = merged(tree, scenario_tree(name))
    changes += [f"{key} = {short_name(label(value))}" for key, value in values.items()]
    try:
        tree = with_values(tree, values, source)
    except PlaceError as problem:
        raise BadInput(f"{source} {problem}") from problem
    if "name" in tree and "name" not in values:
        tree = merged(tree, {"name": ", ".join([str(tree["name"]), *changes])})
    return scenario_of(origin, tree)

"""Aircraft as files: one type with the source of its numbers, named by scenarios.

``aircraft: aerosonde`` in a scenario is a bundled aircraft, ``aircraft: my.yaml`` a file beside the
scenario. Either takes the place of an aircraft that the scenario inherits, whole; a section of
keys, as ever, is merged into it.
"""

from pathlib import Path
from typing import Any

from gcs.scenario.bundled import find_aircraft
from gcs.scenario.fence import left_out, with_plan_files
from gcs.scenario.mission import with_mission_file
from gcs.scenario.plugins import with_plugins
from mavlink_defs.config.files import validate
from mavlink_defs.config.inherit import merged, read_inherited
from mavlink_defs.config.models import ConfigError, Loc, Problem
from mavlink_defs.config.written import WrittenDict, WrittenList, located
from sitl_plant.airframe.config import Aircraft, Coefficients
from sitl_plant.simulators.config import is_own

_OPTIONAL = {key for key, field in Aircraft.model_fields.items() if not field.is_required()}
_OPTIONAL_COEFFICIENTS = {
    key for key, field in Coefficients.model_fields.items() if not field.is_required()
}


def aircraft_tree(path: Path) -> dict[Any, Any]:
    """Read an aircraft file and what it extends, as plain data that is not checked yet.

    Raises:
        ConfigError: A file cannot be read, or holds something else.
    """
    return read_inherited(path, Aircraft.model_fields, find_aircraft)


def load_aircraft(name: str) -> Aircraft:
    """Read an aircraft and check it.

    Args:
        name: A file, or the name of a bundled aircraft.

    Raises:
        ConfigError: The file cannot be used; it names every problem found.
    """
    path = find_aircraft(Path(), name)
    tree = aircraft_tree(path)
    if "aircraft" in tree:
        text = "a scenario, not an aircraft; give what it has at `aircraft`"
        raise ConfigError(path, [Problem((), text)])
    return validate(path, tree, Aircraft)


def with_named_files(path: Path | str, tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree of a scenario with the content of the aircraft and mission files it names.

    A folder that its plant names, and a file with a law, beside the file, are named from the root.

    Args:
        path: The file that the tree is of.
        tree: Plain data read from it.

    Raises:
        ConfigError: A file cannot be used.
    """
    tree = with_plugins(path, with_plan_files(path, with_mission_file(path, tree, left_out)))
    tree = _with_folder(Path(path).parent, tree)
    tree = _with_own_aircraft(path, tree)
    name = tree.get("aircraft")
    if not isinstance(name, str):
        return tree
    return _with(tree, _alone(_named(path, tree, name, ("aircraft",))))


def _with_own_aircraft(path: Path | str, tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree with the aircraft, and the folders of plants, that its UAVs name."""
    uavs = tree.get("uavs")
    if not isinstance(uavs, list):
        return tree
    entries = list(uavs)
    for i, uav in enumerate(uavs):
        if isinstance(uav, dict) and isinstance(name := uav.get("aircraft"), str):
            entries[i] = _with(uav, _named(path, tree, name, ("uavs", i, "aircraft")))
        if isinstance(uav, dict):
            entries[i] = _with_folder(Path(path).parent, entries[i])
    if all(entry is uav for entry, uav in zip(entries, uavs, strict=True)):
        return tree
    listed = WrittenList(entries, uavs.sources if isinstance(uavs, WrittenList) else {})
    sources = tree.sources if isinstance(tree, WrittenDict) else {}
    return WrittenDict({**tree, "uavs": listed}, sources)


def _named(path: Path | str, tree: dict[Any, Any], name: str, loc: Loc) -> dict[Any, Any]:
    """Return the aircraft that a scenario names at a place."""
    try:
        return aircraft_tree(find_aircraft(Path(path).parent, name))
    except ConfigError as error:
        problems = [Problem(loc, line) for line in error.lines]
        raise ConfigError(path, located(tree, problems)) from error


def without_nulls(tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree of a scenario whose aircraft came from a file, but what it leaves out."""
    aircraft = tree.get("aircraft")
    if not isinstance(aircraft, dict):
        return tree
    inner = [part for part in aircraft.values() if isinstance(part, dict)]
    has_nulls = any(None in part.values() for part in (aircraft, *inner))
    return _with(tree, merged({}, aircraft)) if has_nulls else tree


def _with_folder(beside: Path, tree: dict[Any, Any]) -> dict[Any, Any]:
    plant = tree.get("plant")
    name = plant.get("aircraft") if isinstance(plant, dict) else None
    if not isinstance(plant, dict) or not isinstance(name, str) or not is_own(name):
        return tree
    folder = (beside / Path(name).expanduser()).resolve()
    return _with(tree, _with(plant, str(folder)), key="plant")


def _with(tree: dict[Any, Any], value: Any, key: str = "aircraft") -> dict[Any, Any]:
    sources = tree.sources if isinstance(tree, WrittenDict) else {}
    return WrittenDict({**tree, key: value}, sources)


def _alone(aircraft: dict[Any, Any]) -> dict[Any, Any]:
    """Return an aircraft with a null for each key that it leaves out, which inherits nothing."""
    whole = _with_nulls(aircraft, _OPTIONAL)
    if isinstance(coefficients := aircraft.get("coefficients"), dict):
        whole["coefficients"] = _with_nulls(coefficients, _OPTIONAL_COEFFICIENTS)
    return whole


def _with_nulls(tree: dict[Any, Any], keys: set[str]) -> dict[Any, Any]:
    nulls = dict.fromkeys(keys - tree.keys())
    return WrittenDict({**tree, **nulls}, tree.sources if isinstance(tree, WrittenDict) else {})

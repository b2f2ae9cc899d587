"""Configuration files that state only their differences from another file.

``extends: other.yaml`` in a file names its base, relative to the file itself (`read_inherited`
accepts other ways to find it); of several, ``extends: [first.yaml, second.yaml]``, each is merged
into those before it. The file is merged into its base as a JSON Merge Patch (RFC 7396):
mappings merge key by key, a null removes the base's key, anything else, lists included, replaces.
Three rules are added. A mapping with another `kind` than the base's inherits nothing from it, so
that one control law does not get the gains of another. A trigger with another `mode` inherits the
thresholds alone. And `navigation: estimated` inherits no errors of the true state, which are of
flights by it. Each value remembers the file and line where it is written.

A file may name any other, also one that its reader must not see. Of a base that is not YAML, or has
a top-level key that is none of the known ones, messages name the line but nothing of its content.

Errors: ValueError ← PlaceError (no such place in a tree); about files `ConfigError`.
"""

import functools
import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from mavlink_defs.config.files import read
from mavlink_defs.config.models import ConfigError, Problem, shown, unknown_key
from mavlink_defs.config.renamed import present
from mavlink_defs.config.written import Written, WrittenDict, WrittenList, located, written_in
from mavlink_defs.config.yaml_text import yaml_of

OF_TRUE_STATE = "gyro_deg_s", "accelerometer_m_s2", "attitude_deg", "airspeed_m_s"
"""Sections of `sensors` that a flight by an estimated state has no use for."""

OF_ANY_MODE = frozenset(("a1", "a2_n", "b1", "b2_deg"))
"""Keys of a `trigger` that it has in every mode."""

_PLACE = re.compile(r"\w+(?:\.\w+|\[[0-9]+\])*")
_STEP = re.compile(r"\.?(\w+)|\[([0-9]+)\]")  # a key, or an index


class PlaceError(ValueError):
    """A tree has no such place, or it is not written as one; one line that names the place."""


def _beside(folder: Path, name: str) -> Path:
    return folder / name


def _as_it_is(_: Path, tree: dict[Any, Any]) -> dict[Any, Any]:
    return tree


def read_inherited(
    path: Path | str,
    known: Collection[str],
    find: Callable[[Path, str], Path] = _beside,
    complete: Callable[[Path, dict[Any, Any]], dict[Any, Any]] = _as_it_is,
    *,
    is_base: bool = False,
) -> dict[Any, Any]:
    """Read a YAML file and what it extends, as one tree without `extends`.

    Args:
        path: The file.
        known: Top-level keys of such files; a base that has another one is none of them.
        find: Gives the file that a name means, for the folder of the file that extends it.
        complete: Gives the tree to merge, for each file and its tree: what the file takes from
            other files beside it.
        is_base: Another file names this one, so that it is read as what it extends is.

    Raises:
        ConfigError: A file cannot be read, holds something else, or extends itself.
    """

    def read_one(path: Path, above: list[Path]) -> dict[Any, Any]:
        """Read a file that the ones `above` extend."""
        if path.resolve() in above:
            raise ConfigError(path, [Problem((), "extends itself")])
        tree = _read_base(path, known) if above or is_base else read(path)
        tree = complete(path, tree)
        if "extends" not in tree:
            return tree
        given, own = tree["extends"], merged(tree, {"extends": None})
        names = given if isinstance(given, list) else [given]
        if not names or not all(isinstance(name, str) and name for name in names):
            text = f"expected the path of a file, or a list of them, got {shown(given)}"
            raise ConfigError(path, located(tree, [Problem(("extends",), text)]))
        try:
            files = [find(path.parent, name) for name in names]
            bases = [read_one(file, [*above, path.resolve()]) for file in files]
            tree_of: dict[Any, Any] = merged(functools.reduce(joined, bases), own)
            return tree_of
        except ConfigError as exc:
            problems = [Problem(("extends",), line) for line in exc.lines]
            raise ConfigError(path, located(tree, problems)) from exc

    return read_one(Path(path), [])


def _read_base(path: Path, known: Collection[str]) -> dict[Any, Any]:
    """Read a file that another one names."""
    tree = read(path, quoting=False)
    for key in tree:
        if key not in {*known, "extends"}:
            problem = unknown_key((str(key),), known)._replace(loc=())
            source = tree.sources[key] if isinstance(tree, WrittenDict) else ""
            raise ConfigError(path, [problem._replace(source=source)])
    return tree


def merged(base: Any, overlay: Any) -> Any:
    """Return `base` with `overlay` merged into it; neither is changed."""
    if not isinstance(overlay, dict):
        return overlay
    if not isinstance(base, dict) or overlay.get("kind", base.get("kind")) != base.get("kind"):
        base = {}
    base = _without_ruled_out(_in_mode_of(base, overlay), overlay)
    new = WrittenDict(base, _sources(base))
    sources = _sources(overlay)
    for key, value in overlay.items():
        new.sources.pop(key, None)
        new.pop(key, None)  # what is merged comes last: of two names of a key, it counts
        if value is None:
            continue
        new[key] = merged(base.get(key), value)
        if key in sources:
            new.sources[key] = sources[key]
    return new


def joined(base: dict[Any, Any], addition: dict[Any, Any]) -> dict[Any, Any]:
    """Return `base` with the tree of a file merged into it that was written for any flight.

    Of those two, each leaves out what the other one rules out: their order does not count.
    """
    if "navigation" not in addition:
        addition = _without_ruled_out(addition, base)
    tree: dict[Any, Any] = merged(base, addition)
    return tree


def _in_mode_of(base: dict[Any, Any], overlay: dict[Any, Any]) -> dict[Any, Any]:
    """Return what a mapping inherits; a trigger with another mode has its thresholds alone."""
    old, new = base.get("mode"), overlay.get("mode")
    if old is None or new is None or old == new or not base.keys() & OF_ANY_MODE:
        return base
    kept = {key: value for key, value in base.items() if key in OF_ANY_MODE}
    return WrittenDict(kept, _sources(base))


def _without_ruled_out(tree: dict[Any, Any], other: dict[Any, Any]) -> dict[Any, Any]:
    """Return the part of a scenario that has a meaning beside another part."""
    sensors = tree.get("sensors")
    if other.get("navigation") != "estimated" or not isinstance(sensors, dict):
        return tree
    left = merged(sensors, dict.fromkeys(OF_TRUE_STATE))
    return WrittenDict({**tree, "sensors": left}, _sources(tree))


def _sources(tree: Any) -> dict[Any, str]:
    return dict(tree.sources) if isinstance(tree, Written) else {}


def difference(base: Any, tree: Any) -> Any:
    """Return an overlay that `merged` lays over `base` to get `tree`, which holds no null."""
    if not isinstance(base, dict) or not isinstance(tree, dict):
        return tree
    if tree.get("kind") != base.get("kind"):
        return {"kind": None, **tree}
    base = _in_mode_of(base, {"mode": tree.get("mode")})
    overlay: dict[Any, Any] = {key: None for key in base if key not in tree}
    for key, value in tree.items():
        if key not in base or yaml_of(base[key]) != yaml_of(value):  # 1 is not 1.0
            overlay[key] = difference(base.get(key), value)
    return overlay


def check_place(place: str) -> None:
    """Check how a place is written; whether a tree has it is another question.

    Raises:
        PlaceError: It is not keys and indices.
    """
    _way(place)


def with_values(
    tree: dict[Any, Any], values: Mapping[str, Any], source: str = ""
) -> dict[Any, Any]:
    """Merge values into single places of a tree, one after the other, as `merged` does.

    Args:
        tree: Plain data; it is not changed.
        values: From places, written as in error messages (``trigger.b2_deg``,
            ``faults[0].effectiveness``), to values. Keys may be new, indices may not.
        source: Where the values are written, such as "--set".

    Raises:
        PlaceError: A place is written in another way, or leads through something that is no
            mapping or list, or beyond the end of a list.
    """
    for place, value in values.items():
        tree = _laid(tree, _way(place), written_in(value, source), source)
    return tree


def value_at(tree: dict[Any, Any], place: str) -> Any:
    """Return what is at a place of a tree, written as for `with_values`, or by a name of before.

    Raises:
        PlaceError: There is no such place, or it is written in another way.
    """
    here: Any = tree
    for step in _way(place):
        name, index = step.groups()
        if name is not None and isinstance(here, dict):
            key = int(name) if name.isdecimal() else name
            if key in here:
                here = here[key]
                continue
        if index is not None and isinstance(here, list) and int(index) < len(here):
            here = here[int(index)]
            continue
        if (now := present(place)) != place:
            return value_at(tree, now)
        raise PlaceError(f"{place}: no such key")
    return here


def _way(place: str) -> list[re.Match[str]]:
    """Return the steps that a place consists of."""
    if not _PLACE.fullmatch(place):
        text = "expected keys and indices as in trigger.b2_deg or faults[0].uav"
        raise PlaceError(f"{place}: {text}")
    return list(_STEP.finditer(place))


def _laid(here: Any, way: list[re.Match[str]], value: Any, source: str) -> Any:
    """Merge a value into what is at the end of a path that begins here."""
    if not way:
        return merged(here, value)
    step, *rest = way
    name, index = step.groups()
    if name is not None and isinstance(here, dict):
        key = int(name) if name.isdecimal() else name
        if not rest:
            return merged(here, WrittenDict({key: value}, {key: source}))
        inner = _laid(here.get(key, {}), rest, value, source)
        others = {other: value for other, value in here.items() if other != key}
        return WrittenDict({**others, key: inner}, {key: source} | _sources(here))
    if index is not None and isinstance(here, list) and int(index) < len(here):
        i = int(index)
        inner = _laid(here[i], rest, value, source)
        sources = _sources(here) | ({} if rest else {i: source})
        return WrittenList([*here[:i], inner, *here[i + 1 :]], sources)
    expected = "a mapping" if name is not None else f"a list of more than {index}"
    place, begin = way[-1].string, step.string[: step.start()]
    raise PlaceError(f"{place}: expected {expected} at {begin}, got {shown(here)}")

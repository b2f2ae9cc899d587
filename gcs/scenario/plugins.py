"""The plug-ins that a scenario names: found beside its file, with the digest of their code."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ftc_autopilot.control.controller import PARAMETERS
from ftc_autopilot.control.laws import KINDS, law_of
from ftc_autopilot.control.laws.plugin import UnreadLaw
from ftc_autopilot.control.plugin_functions import Chosen, bind
from ftc_autopilot.control.triggers import MODES, trigger_of
from ftc_autopilot.control.triggers.plugin import UnreadTrigger
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS as OUR_GUIDANCE_LAWS
from ftc_autopilot.guidance.laws import guidance_of
from ftc_autopilot.guidance.laws.plugin import UnreadGuidance
from ftc_autopilot.plugins.functions import way_of
from ftc_autopilot.plugins.loading import (
    GUIDANCE_LAWS,
    LAWS,
    TRIGGERS,
    check_shadowed,
    label,
    plugin_of,
    resolved,
    runs_code,
    watching,
)
from ftc_autopilot.plugins.models import is_plugin
from gcs.console.errors import BadInput
from gcs.console.stopping import running_code
from mavlink_defs.config.models import ConfigError, Model, Problem
from mavlink_defs.config.written import WrittenDict, located
from mavlink_defs.runtime.foreign import PluginError

_SECTIONS: dict[str, tuple[str, str, tuple[str, ...], Callable[[str], type[Model]]]] = {
    "controller": ("kind", LAWS, KINDS, law_of),
    "trigger": ("mode", TRIGGERS, MODES, trigger_of),
    "guidance": ("kind", GUIDANCE_LAWS, tuple(OUR_GUIDANCE_LAWS), guidance_of),
}
"""Sections that may be a plug-in's: key of its name, group of entry points, our names, loader."""


_UNREAD = (UnreadLaw, UnreadTrigger, UnreadGuidance)


def with_plugins(path: Path | str, tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree of a scenario whose plug-ins are named from the root, with their digests.

    Args:
        path: The file that the tree is of.
        tree: Plain data read from it.

    Raises:
        ConfigError: A plug-in cannot be used.
    """
    for section in _SECTIONS:
        tree = _with_plugin(Path(path), tree, section)
    return tree


def with_choices(
    path: Path | str, tree: dict[Any, Any], choices: Mapping[str, Iterable[Any]]
) -> dict[Any, Any]:
    """Return the tree with the digests of plug-ins that may come to be chosen.

    Args:
        path: The file that the tree is of.
        tree: Plain data of a scenario.
        choices: Values that are laid over it, by key.

    Raises:
        ConfigError: A plug-in cannot be used.
    """
    for section, (key, *_) in _SECTIONS.items():
        for name in choices.get(f"{section}.{key}", ()):
            chosen = with_plugins(path, {section: {key: name}}).get("plugins", {})
            if chosen:
                digests = {**chosen, **tree.get("plugins", {})}
                tree = WrittenDict({**tree, "plugins": digests}, _sources(tree))
    return tree


def _with_plugin(path: Path, tree: dict[Any, Any], section: str) -> dict[Any, Any]:
    key, group, own, load = _SECTIONS[section]
    keys = tree.get(section)
    name = keys.get(key) if isinstance(keys, dict) else None
    try:
        if isinstance(name, str) and name in own:
            check_shadowed(group, name)
        if not isinstance(keys, dict) or not is_plugin(name, group, own):
            return tree
        name = resolved(str(name), path.parent)
        named = WrittenDict({**keys, key: name}, _sources(keys))
        if not runs_code():
            return WrittenDict({**tree, section: named}, _sources(tree))
        with watching(running_code):
            plugin = plugin_of(load(name))
    except PluginError as problem:
        raise ConfigError(path, located(tree, [Problem((section, key), str(problem))])) from problem
    assert plugin is not None
    known = tree.get("plugins")
    digests = {name: plugin.digest, **(known if isinstance(known, dict) else {})}
    return WrittenDict({**tree, section: named, "plugins": digests}, _sources(tree))


def _sources(tree: dict[Any, Any]) -> dict[Any, str]:
    return tree.sources if isinstance(tree, WrittenDict) else {}


def is_unread(chosen: Chosen) -> bool:
    """Return whether a scenario was read without the code of its plug-ins, and cannot be flown."""
    models = (chosen.controller, chosen.trigger, chosen.guidance)
    return any(isinstance(model, _UNREAD) for model in models)


def prepare_plugins(chosen: Chosen) -> list[str]:
    """Compile the functions of a flight's plug-ins, so that its processes find them in the cache.

    Returns:
        What the user should know of them.

    Raises:
        BadInput: One cannot be used.
    """
    law, trigger, guidance = chosen.controller, chosen.trigger, chosen.guidance
    try:
        bind(np.zeros(1, PARAMETERS)[0], chosen)
    except PluginError as problem:
        raise BadInput(str(problem)) from problem
    return [
        f"{label(plugin.name)} is plain Python: its step takes about ten times as long as one "
        "of compiled Python (@compiled), or of a shared library"
        for model in (law, trigger, guidance)
        if (plugin := plugin_of(type(model))) is not None and way_of(type(model)) == "plain Python"
    ]


def libraries_of(*models: Model) -> list[str]:
    """Return the names of the plug-ins among some that are shared libraries."""
    return [
        label(plugin.name)
        for model in models
        if (plugin := plugin_of(type(model))) is not None
        and way_of(type(model)) == "shared library"
    ]

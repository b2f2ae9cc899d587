"""What the parameter protocol does not carry: units, ranges, meanings, defaults of parameters.

A default is what a parameter is if the scenario leaves its key out. What a vehicle started with is
not on the wire, so a value that its scenario has differs from the default like one that was
set in flight.
"""

import contextlib
import functools
import math
from collections.abc import Collection, Iterable, Iterator

import numpy as np

from ftc_autopilot.common.records import fill
from ftc_autopilot.control.controller import PARAMETERS
from ftc_autopilot.control.laws import KINDS, LAWS, PLUGIN_LAW, law_of, own_parameters
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.triggers import MODES, PLUGIN_MODE, TRIGGERS, trigger_of
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.plugin import own_record
from ftc_autopilot.guidance.failsafe_parameters import FailsafeParameters
from ftc_autopilot.guidance.fence_parameters import FenceParameters, RallyParameters, fence_records
from ftc_autopilot.guidance.formation import FormationParameters
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.plugins.loading import LAWS as LAW_GROUP
from ftc_autopilot.plugins.loading import TRIGGERS as TRIGGER_GROUP
from ftc_autopilot.plugins.loading import registered
from ftc_autopilot.vehicle.param_table import (
    Tunable,
    fence_tunables,
    law_tunables,
    trigger_tunables,
    tunables,
)
from gcs.station.param_file import READ_ONLY
from mavlink_defs.config import renamed
from mavlink_defs.config.quantity import Quantity
from mavlink_defs.float32 import float32s
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.services.param import Param

__all__ = ["READ_ONLY", "Defaults", "defaults_of", "differs", "known_quantity", "permitted"]

Defaults = dict[str, tuple[float, ...]]
"""Defaults of parameters by name; of a scheduled one all values of its schedule, in order."""

_FIXED = {
    "SYSID_THISMAV": "System id, read only.",
    "MAV_TYPE": "MAV_TYPE of the heartbeat, read only.",
    "MAV_AUTOPILOT": "MAV_AUTOPILOT of the heartbeat, read only.",
    "STEP_US": "Control period, read only.",
    "CTRL_LAW": ", ".join(f"{i} {kind}" for i, kind in enumerate(LAWS))
    + f", {PLUGIN_LAW} a plug-in; read only.",
}


def permitted(name: str) -> str:
    """Return which values a parameter takes: "[0, 10]", "read only"; "" if that is unknown."""
    if name in READ_ONLY:
        return "read only"
    known = known_quantity(name)
    return known.bounds() if known else ""


def known_quantity(name: str) -> Quantity | None:
    """Return unit, range and meaning of a parameter; None for one that our vehicles lack."""
    return _known().get(renamed.PARAMETERS.get(name, name))


def defaults_of(held: Iterable[Param]) -> Defaults:
    """Return the defaults of a vehicle's parameters, as far as they are known.

    Args:
        held: The parameters. CTRL_LAW among them is the law; without it the vehicle is none of
            ours and no default is known.
    """
    values = {param.name: param.value for param in held}
    law = values.get("CTRL_LAW", math.nan)
    if law not in range(len(KINDS) + 1):
        return {}
    kind = KINDS[int(law)] if law != PLUGIN_LAW else _plugin_with(values)
    known = {} if kind is None else _defaults(kind)
    return {name: known[name] for name in values if name in known}


def _plugin_with(names: Collection[str]) -> str | None:
    """Return the installed law whose parameters a vehicle has; None if there is not just one."""
    found = [
        kind
        for kind, law in _plugins().items()
        if all(one.name in names for one in law_tunables(law, np.zeros(1, law.record())))
    ]
    return found[0] if len(found) == 1 else None


@functools.cache
def _plugins() -> dict[str, type[LawParameters]]:
    """Return the laws that other packages register and that can be used, by name."""
    found: dict[str, type[LawParameters]] = {}
    for name in registered(LAW_GROUP).keys() - LAWS.keys():
        with contextlib.suppress(PluginError):
            found[name] = law_of(name)
    return found


def _trigger_tunables() -> Iterator[Tunable]:
    """Yield the numbers of the triggers that other packages register."""
    for mode in registered(TRIGGER_GROUP).keys() - TRIGGERS.keys():
        with contextlib.suppress(PluginError):
            trigger = trigger_of(mode)
            own = np.zeros(1, own_record(trigger))
            yield from tunables(trigger, own, "TRIG_", base=TriggerParameters)


def differs(param: Param, defaults: Defaults) -> bool:
    """Return whether a value is none of its defaults; False where none is known.

    Numbers are compared as the wire carries them, in 32 bits.
    """
    known = defaults.get(param.name)
    return known is not None and float32s([param.value])[0] not in float32s(known)


@functools.cache
def _known() -> dict[str, Quantity]:
    fixed = {name: Quantity("", None, None, None, None, doc) for name, doc in _FIXED.items()}
    fixed["STEP_US"] = Quantity("us", None, None, None, None, _FIXED["STEP_US"])
    found = [tunable for kind in LAWS for tunable in _tunables(kind)]
    for law in _plugins().values():
        found += law_tunables(law, np.zeros(1, law.record()))
    found += _trigger_tunables()
    return fixed | {tunable.name: tunable.quantity for tunable in reversed(found)}


@functools.cache
def _defaults(kind: str) -> Defaults:
    found: Defaults = {}
    for tunable in _tunables(kind):
        last = int(np.argmax(np.isinf(tunable.times)))
        values = dict.fromkeys(tunable.at(t) for t in tunable.times[: last + 1].tolist())
        if all(map(math.isfinite, values)):  # a key may stand for one of another section
            found.setdefault(tunable.name, tuple(values))
    return found


def _tunables(kind: str) -> Iterator[Tunable]:
    """Yield what can be set in a vehicle with a law, at its default: of every trigger, too."""
    law = law_of(kind)
    records = np.zeros(1, PARAMETERS)
    records["mode"] = MODES.index(law.TRIGGER) if law.TRIGGER in MODES else PLUGIN_MODE
    fill(records["trigger"][0], trigger_of(law.TRIGGER)(mode=law.TRIGGER))
    for mode in MODES:
        if mode in (records.dtype["trigger"].names or ()):
            fill(records["trigger"][mode][0], TRIGGERS[mode](mode=mode))
    fill(records["common"][0], law(kind=kind))
    own = own_parameters(records, law, kind)
    law(kind=kind).write_to(own[0])
    fill(records["formation"][0], FormationParameters())
    for name, guidance in GUIDANCE_LAWS.items():
        fill(records["guidance"][name][0], guidance(kind=name))
    yield from trigger_tunables(records)
    yield from tunables(LawParameters, records["common"])
    yield from tunables(FormationParameters, records["formation"], "FORM_")
    for name, guidance in GUIDANCE_LAWS.items():
        yield from tunables(guidance, records["guidance"][name], "GUID_", base=GuidanceParameters)
    for mode in MODES:
        yield from trigger_tunables(records, mode)
    yield from law_tunables(law, own)
    yield from tunables(FailsafeParameters, records["failsafe"], "COM_")
    yield from fence_tunables(fence_records(FenceParameters(), RallyParameters()))

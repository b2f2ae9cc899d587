"""Triggers that a scenario can choose by name: when which command is transmitted.

A trigger is one file: a model of its parameters, with its `mode` and the `STATE` that it keeps,
and a compiled function. To register one of ours, add the model to `Trigger` and the call to
`decide`; the check of scenario files and the records that compiled code sees follow. Triggers of
other packages and files have one branch in common, `plugin`.
"""

from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import BeforeValidator, Discriminator, SerializeAsAny, Tag

from ftc_autopilot.control.triggers import static
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.control.triggers.dynamic import Dynamic, dynamic
from ftc_autopilot.control.triggers.periodic import Periodic, Times, clock, periodic
from ftc_autopilot.control.triggers.periodic_event import PeriodicEvent, periodic_event
from ftc_autopilot.control.triggers.plugin import TRIGGER, plugin_trigger
from ftc_autopilot.control.triggers.scaled import Scaled, scaled
from ftc_autopilot.control.triggers.self_triggered import SelfTriggered, self_triggered
from ftc_autopilot.plugins.loading import TRIGGERS as GROUP
from ftc_autopilot.plugins.models import PLUGIN, PLUGIN_TAG, is_plugin, model_of
from mavlink_defs.runtime.jit import compiled


def _mode(value: Any) -> Any:
    own = getattr(value, "mode", "per_channel")
    mode = value.get("mode", "per_channel") if isinstance(value, dict) else own
    return PLUGIN_TAG if is_plugin(mode, GROUP, MODES) else mode


def trigger_of(mode: str) -> type[TriggerParameters]:
    """Return the parameters' class of a trigger: one of ours, or a plug-in's.

    Raises:
        PluginError: The plug-in cannot be used.
    """
    return TRIGGERS.get(mode) or TRIGGER.load(mode)


Trigger: TypeAlias = Annotated[
    Annotated[static.PerChannel, Tag("per_channel")]
    | Annotated[static.Joint, Tag("joint")]
    | Annotated[Periodic, Tag("periodic")]
    | Annotated[Dynamic, Tag("dynamic")]
    | Annotated[PeriodicEvent, Tag("periodic_event")]
    | Annotated[SelfTriggered, Tag("self")]
    | Annotated[static.Consequence, Tag("consequence")]
    | Annotated[Scaled, Tag("scaled")]
    | Annotated[
        SerializeAsAny[TriggerParameters],
        BeforeValidator(model_of("mode", trigger_of)),
        Tag(PLUGIN_TAG),
    ],
    Discriminator(_mode),
]
"""The parameters of any trigger, discriminated by `mode`."""

TRIGGERS: dict[str, type[TriggerParameters]] = {
    get_args(trigger)[-1].tag: get_args(trigger)[0]
    for trigger in get_args(get_args(Trigger)[0])[:-1]
}
"""Our own triggers by name."""
MODES = tuple(TRIGGERS)
PLUGIN_MODE = len(MODES)
"""Number of a trigger that is a plug-in; ours have their index in `MODES`."""
_JOINT = MODES.index("joint")
_PERIODIC = MODES.index("periodic")
_DYNAMIC = MODES.index("dynamic")
_PERIODIC_EVENT = MODES.index("periodic_event")
_SELF = MODES.index("self")
_CONSEQUENCE = MODES.index("consequence")
_SCALED = MODES.index("scaled")


@compiled
def clock_of(mode: int, dt: float, parameters: np.void, states: np.void) -> tuple[int, Times]:
    """Return which channels a clock sends in this step, and its periods; zeros without a clock.

    Args:
        mode: Index in `MODES`.
        dt: Control period [s].
        parameters: Record `trigger` of `ftc_autopilot.control.controller.PARAMETERS`.
        states: Record `trigger` of `ftc_autopilot.control.controller.CONTROLLER`; read only.

    Returns:
        Mask with bit numbers as FTC_ACTUATOR, and the period of each channel [s].
    """
    if mode == _PERIODIC:
        return clock(dt, parameters["periodic"], states["periodic"])
    return 0, (0.0, 0.0, 0.0, 0.0)


@compiled
def decide(now: Candidates, mode: int, parameters: np.void, states: np.void) -> int:
    """Return the mask of the channels that transmit, bit numbers as FTC_ACTUATOR.

    Args:
        now: The present step.
        mode: Index in `MODES`.
        parameters: Record `trigger` of `ftc_autopilot.control.controller.PARAMETERS`.
        states: Record `trigger` of `ftc_autopilot.control.controller.CONTROLLER`; the trigger's
            own part is updated in place.
    """
    if mode == _JOINT:
        return static.joint(now)
    if mode == _PERIODIC:
        return periodic(now, parameters["periodic"], states["periodic"])
    if mode == _DYNAMIC:
        return dynamic(now, parameters["dynamic"], states["dynamic"])
    if mode == _PERIODIC_EVENT:
        return periodic_event(now, parameters["periodic_event"], states["periodic_event"])
    if mode == _SELF:
        return self_triggered(now, parameters["self"], states["self"])
    if mode == _CONSEQUENCE:
        return static.consequence(now)
    if mode == _SCALED:
        return scaled(now, parameters["scaled"], states["scaled"])
    if mode == PLUGIN_MODE:
        return plugin_trigger(now, parameters[PLUGIN], states[PLUGIN])
    return static.per_channel(now)

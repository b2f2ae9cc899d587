"""Control laws that a scenario can choose by name.

A law is one file: a model of its parameters, with its `kind` and the `STATE` that it keeps,
and a compiled function. To register one of ours, add the model to `Controller` and the call to
`evaluate`; the check of scenario files and the records that compiled code sees follow. Laws of
other packages and files have one branch in common, `plugin`.
"""

from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import BeforeValidator, Discriminator, SerializeAsAny, Tag

from ftc_autopilot.control.heading import HeadingLoop
from ftc_autopilot.control.laws.backstepping import Backstepping, backstepping_law
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.pid import Pid, pid_law
from ftc_autopilot.control.laws.plugin import LAW, plugin_law
from ftc_autopilot.control.laws.proposed import Proposed, proposed_law
from ftc_autopilot.control.laws.surviving import Surviving, surviving_law
from ftc_autopilot.control.laws.tube import Tube, tube_law
from ftc_autopilot.control.step import (
    Command,
    ControllerRecord,
    ParametersRecord,
    SignalsRecord,
    Step,
)
from ftc_autopilot.plugins.loading import LAWS as GROUP
from ftc_autopilot.plugins.models import PLUGIN, PLUGIN_TAG, is_plugin, model_of, owned
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord


def _kind(value: Any) -> Any:
    own = getattr(value, "kind", "proposed")
    kind = value.get("kind", "proposed") if isinstance(value, dict) else own
    return PLUGIN_TAG if is_plugin(kind, GROUP, KINDS) else kind


def law_of(kind: str) -> type[LawParameters]:
    """Return the parameters' class of a law: one of ours, or a plug-in's.

    Raises:
        PluginError: The plug-in cannot be used.
    """
    return LAWS.get(kind) or LAW.load(kind)


Controller: TypeAlias = Annotated[
    Annotated[Proposed, Tag("proposed")]
    | Annotated[Backstepping, Tag("backstepping")]
    | Annotated[Pid, Tag("pid")]
    | Annotated[Surviving, Tag("surviving")]
    | Annotated[Tube, Tag("tube")]
    | Annotated[
        SerializeAsAny[LawParameters],
        BeforeValidator(model_of("kind", law_of)),
        Tag(PLUGIN_TAG),
    ],
    Discriminator(_kind),
]
"""The parameters of any law, discriminated by `kind`."""

LAWS: dict[str, type[LawParameters]] = {
    get_args(law)[-1].tag: get_args(law)[0] for law in get_args(get_args(Controller)[0])[:-1]
}
"""Our own laws by name."""
KINDS = tuple(LAWS)
PLUGIN_LAW = len(KINDS)
"""Number of a law that is a plug-in; ours have their index in `KINDS`."""
_BACKSTEPPING = KINDS.index("backstepping")
_PID = KINDS.index("pid")
_SURVIVING = KINDS.index("surviving")
_TUBE = KINDS.index("tube")


def own_parameters(records: Any, law: type[LawParameters], kind: str) -> Any:
    """Return the parameters of a law in a record of PARAMETERS, or in an array of shape (1,)."""
    return records[kind] if kind in LAWS else owned(records[PLUGIN], law.record())


def own_state(records: Any, law: type[LawParameters], kind: str) -> Any:
    """Return the state of a law in a record of CONTROLLER."""
    return records[kind] if kind in LAWS else owned(records[PLUGIN], law.STATE)


@compiled
def heading_loop(parameters: ParametersRecord) -> HeadingLoop:
    """Return how the law that a scenario has chosen holds the heading."""
    law = parameters["law"]
    if law == _SURVIVING:
        return _heading_loop(parameters["surviving"])
    if law == _TUBE:
        return _heading_loop(parameters["tube"]["fallback"])
    if law == PLUGIN_LAW:
        return _heading_loop(parameters[PLUGIN])
    return HeadingLoop(False, 0.0, 0.0)


@compiled
def _heading_loop(gains: np.void) -> HeadingLoop:
    return HeadingLoop(gains["by_bank"] != 0, gains["heading_gain_1_s"], gains["bank_limit_rad"])


@inlined
def evaluate(
    now: Step,
    aircraft: AircraftRecord,
    parameters: ParametersRecord,
    states: ControllerRecord,
    signals: SignalsRecord,
) -> Command:
    """Evaluate the law that a scenario has chosen, and advance its state.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        parameters: Of the controller.
        states: The law's own part is updated in place.
        signals: A law may write to it.
    """
    law = parameters["law"]
    if law == _BACKSTEPPING:
        return backstepping_law(now, aircraft, parameters["backstepping"], states["backstepping"])
    if law == _PID:
        return pid_law(now, aircraft, parameters["pid"], states["pid"])
    if law == _SURVIVING:
        return surviving_law(now, aircraft, parameters["surviving"], states["surviving"], signals)
    if law == _TUBE:
        return tube_law(now, aircraft, parameters["tube"], states["tube"], signals)
    if law == PLUGIN_LAW:
        return plugin_law(now, aircraft, parameters[PLUGIN], states, signals)
    return proposed_law(now, aircraft, parameters["proposed"], states["proposed"], signals)

"""Control laws that a scenario can choose by name.

A law is one file: a model of its parameters, with its `kind` and the `STATE` that it keeps,
and a compiled function. To register it, add the model to `Controller` and the call to
`evaluate`; the check of scenario files and the records that compiled code sees follow.
"""

from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import Discriminator, Tag

from ftc_autopilot.control.heading import HeadingLoop
from ftc_autopilot.control.laws.backstepping import Backstepping, backstepping_law
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.pid import Pid, pid_law
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
from mavlink_defs.runtime.jit import compiled
from sitl_plant.aircraft import AircraftRecord


def _kind(value: Any) -> Any:
    if isinstance(value, dict):
        return value.get("kind", "proposed")
    return getattr(value, "kind", "proposed")


Controller: TypeAlias = Annotated[
    Annotated[Proposed, Tag("proposed")]
    | Annotated[Backstepping, Tag("backstepping")]
    | Annotated[Pid, Tag("pid")]
    | Annotated[Surviving, Tag("surviving")]
    | Annotated[Tube, Tag("tube")],
    Discriminator(_kind),
]
"""The parameters of any law, discriminated by `kind`."""

LAWS: dict[str, type[LawParameters]] = {
    get_args(law)[1].tag: get_args(law)[0] for law in get_args(get_args(Controller)[0])
}
KINDS = tuple(LAWS)
_BACKSTEPPING = KINDS.index("backstepping")
_PID = KINDS.index("pid")
_SURVIVING = KINDS.index("surviving")
_TUBE = KINDS.index("tube")


@compiled
def heading_loop(parameters: ParametersRecord) -> HeadingLoop:
    """Return how the law that a scenario has chosen holds the heading."""
    law = parameters["law"]
    if law == _SURVIVING:
        return _heading_loop(parameters["surviving"])
    if law == _TUBE:
        return _heading_loop(parameters["tube"]["fallback"])
    return HeadingLoop(False, 0.0, 0.0)


@compiled
def _heading_loop(gains: np.void) -> HeadingLoop:
    return HeadingLoop(gains["by_bank"] != 0, gains["heading_gain_1_s"], gains["bank_limit_rad"])


@compiled
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
    return proposed_law(now, aircraft, parameters["proposed"], states["proposed"], signals)

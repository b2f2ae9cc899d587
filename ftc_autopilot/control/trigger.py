"""From a law's demand to the wire: saturation, the trigger's decision, what is held.

Commands are compared after saturation: an actuator at its stop needs no further command. The
held value is the one on the wire, a float32 share of the limit, so controller, plant and
captures agree on it to the last bit.
"""

import numpy as np

from ftc_autopilot.control.laws.base import Demand
from ftc_autopilot.control.triggers import decide
from ftc_autopilot.control.triggers.base import Candidates
from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled

__all__ = ["on_wire", "trigger"]


@compiled
def on_wire(command: float, lowest: float, highest: float) -> np.float32:
    """Return the command as HIL_ACTUATOR_CONTROLS has it: saturated, a share of the limit."""
    return np.float32(min(max(command, lowest), highest) / highest)


@compiled
def trigger(
    demand: Demand,
    dt: float,
    first: bool,
    chosen: int,
    a: tuple[float, float],
    b: tuple[float, float],
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    controls: np.ndarray,
) -> int:
    """Decide which channels transmit, and put their new values on the wire.

    Args:
        demand: What the law asks for.
        dt: Control period [s].
        first: True for the very first command, which is always sent.
        chosen: Bit mask of the channels that the law has chosen.
        a: Thresholds a1 [-], a2 [N] of (25).
        b: Thresholds b1 [-], b2 [rad] of (29).
        aircraft: Nominal aircraft, whose limits saturate the command.
        parameters: Record of dtype `ftc_autopilot.control.controller.PARAMETERS`.
        state: Record of dtype `ftc_autopilot.control.controller.CONTROLLER`; `held` is updated
            where a channel transmits, and so is the trigger's memory.
        controls: HIL_ACTUATOR_CONTROLS.controls, updated where a channel transmits.

    Returns:
        Bit mask of the channels that transmit, bit numbers as FTC_ACTUATOR.
    """
    stop, T_max, held = aircraft["surface_limit"], aircraft["thrust_limit"], state["held"]
    wanted = (
        min(max(demand.delta_hat[0], -stop), stop),
        min(max(demand.delta_hat[1], -stop), stop),
        min(max(demand.delta_hat[2], -stop), stop),
        min(max(demand.T_hat, 0.0), T_max),
    )
    now = Candidates(
        dt, first, wanted, held, chosen, (b[0], b[0], b[0], a[0]), (b[1], b[1], b[1], a[1])
    )
    mask = decide(now, parameters["mode"], parameters["trigger"], state["trigger"])
    for i in range(THROTTLE):
        if mask & (1 << i):
            controls[i] = on_wire(wanted[i], -stop, stop)
            held[i] = controls[i] * stop
    if mask & (1 << THROTTLE):
        controls[THROTTLE] = on_wire(wanted[THROTTLE], 0.0, T_max)
        held[THROTTLE] = controls[THROTTLE] * T_max
    return mask

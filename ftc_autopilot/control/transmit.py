"""From a law's demand to the wire: saturation, the trigger's decision, what is held.

Commands are compared after saturation: an actuator at its stop needs no further command. The
held value is the one on the wire, a float32 share of the limit, so controller, plant and
captures agree on it to the last bit. A demand that is not finite is never sent, whatever law and
trigger say: its channel holds the last command.
"""

import math

import numpy as np

from ftc_autopilot.control.laws.base import Demand
from ftc_autopilot.control.triggers import decide
from ftc_autopilot.control.triggers.base import Candidates
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled


@compiled
def on_wire(command: float, lowest: float, highest: float) -> np.float32:
    """Return the command as HIL_ACTUATOR_CONTROLS has it: saturated, a share of the limit."""
    return np.float32(min(max(command, lowest), highest) / highest)


@compiled
def not_finite(demand: Demand) -> int:
    """Return the mask of the channels whose demand is infinite or no number, as FTC_ACTUATOR."""
    mask = 0
    for i in range(THROTTLE):
        if not math.isfinite(demand.delta_hat[i]):
            mask |= 1 << i
    if not math.isfinite(demand.T_hat):
        mask |= 1 << THROTTLE
    return mask


@compiled
def _saturated(asked: float, lowest: float, highest: float, held: float) -> float:
    """Return a demand within its limits; the command in force for one that is not finite."""
    return min(max(asked, lowest), highest) if math.isfinite(asked) else held


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
            where a channel transmits, and so is the trigger's memory; demands that are not finite
            are counted.
        controls: HIL_ACTUATOR_CONTROLS.controls, updated where a channel transmits.

    Returns:
        Bit mask of the channels that transmit, bit numbers as FTC_ACTUATOR.
    """
    stop, T_max, held = aircraft["surface_limit"], aircraft["thrust_limit"], state["held"]
    wanted = (
        _saturated(demand.delta_hat[0], -stop, stop, held[0]),
        _saturated(demand.delta_hat[1], -stop, stop, held[1]),
        _saturated(demand.delta_hat[2], -stop, stop, held[2]),
        _saturated(demand.T_hat, 0.0, T_max, held[THROTTLE]),
    )
    now = Candidates(
        dt, first, wanted, held, chosen, (b[0], b[0], b[0], a[0]), (b[1], b[1], b[1], a[1])
    )
    mask = decide(now, parameters["mode"], parameters["trigger"], state["trigger"])
    failed = not_finite(demand)
    if failed != 0:
        mask &= ~failed
        for i in range(N_CHANNELS):
            state["not_finite"][i] += (failed >> i) & 1
    for i in range(THROTTLE):
        if mask & (1 << i):
            controls[i] = on_wire(wanted[i], -stop, stop)
            held[i] = controls[i] * stop
    if mask & (1 << THROTTLE):
        controls[THROTTLE] = on_wire(wanted[THROTTLE], 0.0, T_max)
        held[THROTTLE] = controls[THROTTLE] * T_max
    return mask

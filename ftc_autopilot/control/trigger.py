"""Event triggers: eqs. (25) and (29) of the paper, or the law's own choice.

A command is held until it has drifted from the held value by a share of that value plus a
constant. Commands are compared after saturation: an actuator at its stop
needs no further command. The held value is the one on the wire, a float32 share of the limit,
so controller, plant and captures agree on it to the last bit.
"""

import numpy as np

from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3

__all__ = [
    "CONSEQUENCE",
    "JOINT",
    "PERIODIC",
    "PER_CHANNEL",
    "fires",
    "on_wire",
    "trigger",
]

PER_CHANNEL = 0
JOINT = 1
PERIODIC = 2
CONSEQUENCE = 3


@compiled
def fires(candidate: float, held: float, relative: float, absolute: float) -> bool:
    """Return whether (25), or (29) for one surface, asks for a transmission.

    Args:
        candidate: What the law asks for now.
        held: What was sent last, same unit.
        relative: Relative threshold, a1 or b1.
        absolute: Absolute threshold, a2 or b2, same unit as the command.
    """
    return abs(candidate - held) >= relative * abs(held) + absolute


@compiled
def on_wire(command: float, lowest: float, highest: float) -> np.float32:
    """Return the command as HIL_ACTUATOR_CONTROLS has it: saturated, a share of the limit."""
    return np.float32(min(max(command, lowest), highest) / highest)


@compiled
def trigger(
    delta_hat: Vec3,
    T_hat: float,
    held: np.ndarray,
    first: bool,
    mode: int,
    chosen: int,
    a: tuple[float, float],
    b: tuple[float, float],
    aircraft: np.void,
    controls: np.ndarray,
) -> int:
    """Decide which channels transmit, and put their new values on the wire.

    Args:
        delta_hat: Aileron, elevator, rudder that the law asks for [rad].
        T_hat: Thrust that the law asks for [N].
        held: Held commands [rad, rad, rad, N], shape (4,); updated where a channel transmits.
        first: True for the very first command, which is always sent.
        mode: `PER_CHANNEL`, `JOINT`, `PERIODIC`: no trigger, every channel transmits; or
            `CONSEQUENCE`: those transmit that the law has chosen.
        chosen: Bit mask of the channels that the law has chosen.
        a: Thresholds a1 [-], a2 [N] of (25).
        b: Thresholds b1 [-], b2 [rad] of (29).
        aircraft: Nominal aircraft, whose limits saturate the command.
        controls: HIL_ACTUATOR_CONTROLS.controls, updated where a channel transmits.

    Returns:
        Bit mask of the channels that transmit, bit numbers as FTC_ACTUATOR.
    """
    everything = first or mode == PERIODIC
    stop, T_max = aircraft["surface_limit"], aircraft["thrust_limit"]
    mask = 0
    if mode == CONSEQUENCE:
        mask = 0b1111 if first else chosen
    else:
        for i in range(THROTTLE):
            if everything or fires(min(max(delta_hat[i], -stop), stop), held[i], b[0], b[1]):
                mask |= 1 << i
        if mode == JOINT and mask != 0:
            mask = 0b0111
        if everything or fires(min(max(T_hat, 0.0), T_max), held[THROTTLE], a[0], a[1]):
            mask |= 1 << THROTTLE
    for i in range(THROTTLE):
        if mask & (1 << i):
            controls[i] = on_wire(delta_hat[i], -stop, stop)
            held[i] = controls[i] * stop
    if mask & (1 << THROTTLE):
        controls[THROTTLE] = on_wire(T_hat, 0.0, T_max)
        held[THROTTLE] = controls[THROTTLE] * T_max
    return mask

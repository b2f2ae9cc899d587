"""From a law's command to the wire: saturation, the trigger's decision, what is held.

Commands are compared after saturation: an actuator at its stop needs no further command. The
held value is the one on the wire, a float32 share of the limit, so controller, plant and
captures agree on it to the last bit. A command that is not finite is never sent, whatever law and
trigger say: its channel holds the last one.
"""

import math

import numpy as np

from ftc_autopilot.common.tuples import Four
from ftc_autopilot.control.step import Command, ControllerRecord, ParametersRecord, Step
from ftc_autopilot.control.triggers import decide
from ftc_autopilot.control.triggers.base import Candidates
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.stops import has_actuator, position_of, range_of, share_of
from sitl_plant.airframe.thrust import reach_of
from sitl_plant.vec3 import clamp


@compiled
def not_finite(command: Command) -> int:
    """Return the mask of the channels whose command is infinite or no number."""
    mask = 0
    for i in range(THROTTLE):
        if not math.isfinite(command.delta[i]):
            mask |= 1 << i
    if not math.isfinite(command.thrust):
        mask |= 1 << THROTTLE
    return mask


@compiled
def _saturated(commanded: float, j: int, V: float, aircraft: AircraftRecord, held: float) -> float:
    """Return a command within its reach; the one in force in place of one that is not finite."""
    lowest, highest = reach_of(aircraft, j, V)
    return clamp(commanded, lowest, highest) if math.isfinite(commanded) else held


@compiled
def saturated(command: Command, now: Step, aircraft: AircraftRecord) -> Four:
    """Return commands within their reach [rad, rad, rad, N], as above."""
    held, V = now.held, now.motion.V
    return (
        _saturated(command.delta[0], AILERON, V, aircraft, held[0]),
        _saturated(command.delta[1], ELEVATOR, V, aircraft, held[1]),
        _saturated(command.delta[2], RUDDER, V, aircraft, held[2]),
        _saturated(command.thrust, THROTTLE, V, aircraft, held[THROTTLE]),
    )


@inlined
def transmit(
    command: Command,
    now: Step,
    aircraft: AircraftRecord,
    parameters: ParametersRecord,
    state: ControllerRecord,
    controls: np.ndarray,
    examined: int,
) -> int:
    """Decide which channels transmit, and put their new values on the wire.

    Args:
        command: What the law commands.
        now: The present step; in the law's first one all channels transmit.
        aircraft: Nominal aircraft, whose limits saturate the command.
        parameters: Of the controller.
        state: `held` is updated
            where a channel transmits, and so is the trigger's memory; commands that are not finite
            are counted.
        controls: HIL_ACTUATOR_CONTROLS.controls, updated where a channel transmits.
        examined: Mask of the channels whose actuator a diagnosis suspects, or has lost.

    Returns:
        Bit mask of the channels that transmit, bit numbers as FTC_ACTUATOR.
    """
    held, commanded = state["held"], saturated(command, now, aircraft)
    a, b = now.thresholds.a, now.thresholds.b
    candidates = Candidates(
        dt=now.dt,
        first=now.first,
        selected=command.channels,
        commanded=commanded,
        held=now.held,
        relative=(b[0], b[0], b[0], a[0]),
        absolute=(b[1], b[1], b[1], a[1]),
        examined=examined,
    )
    mask = decide(candidates, parameters["mode"], parameters["trigger"], state["trigger"])
    for i in range(N_CHANNELS):
        if not has_actuator(aircraft, i):
            mask &= ~(1 << i)
    failed = not_finite(command)
    if failed != 0:
        mask &= ~failed
        for i in range(N_CHANNELS):
            state["not_finite"][i] += (failed >> i) & 1
    for i in range(N_CHANNELS):
        if mask & (1 << i):
            lowest, highest = range_of(aircraft, i)
            controls[i] = share_of(commanded[i], lowest, highest)
            held[i] = position_of(controls[i], lowest, highest)
    return mask

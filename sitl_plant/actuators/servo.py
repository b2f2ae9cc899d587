"""Servos: from the command that the plant holds to the position that the servo has.

In this order: dead time, rounding to the resolution, first-order lag with a limited rate, play.
Faults come after the servo: they act on what the actuator does (`sitl_plant.actuators.faults`), so
an actuator that is stuck at a position is there at once and stays there, and the servo behind it
goes on following its commands. Only a hard-over is the servo's own: it runs away as fast as it can.

The target of a servo is constant over a control period, so that the lag with its limit has a
closed solution there; the integration evaluates it at its stages. No control period is too
long for a lag, and no lag too short.
"""

import math

import numpy as np

from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators.config import ActuatorServos, EngineServo, SurfaceServo
from sitl_plant.actuators.faults import Controls, servo_command
from sitl_plant.actuators.lag import lagged
from sitl_plant.vec3 import clamp

_EACH = (N_CHANNELS,)

SERVOS = np.dtype(
    [
        ("ideal", "i8"),  # 1: all follow at once
        ("settled", "i8"),  # 1: they have come to rest at their first commands
        ("lag", "f8", _EACH),  # s
        ("rate_limit", "f8", _EACH),  # rad/s or N/s, inf: none
        ("dead_steps", "i8", _EACH),  # control periods
        ("half_play", "f8", _EACH),  # rad or N
        ("resolution", "f8", _EACH),  # rad or N
        ("target", "f8", _EACH),  # where they go to in this period [rad or N]
        ("shaft", "f8", _EACH),  # where they stood when it began, before the play [rad or N]
        ("output", "f8", _EACH),  # the same behind the play
    ]
)
"""The servos of one aircraft and their state; aileron, elevator, rudder, throttle."""


def new_servos(servos: ActuatorServos, step_us: int) -> np.void:
    """Return the servos of one aircraft, dtype `SERVOS`.

    Args:
        servos: Their configuration.
        step_us: Control period [µs].
    """
    record: np.void = np.zeros(1, SERVOS)[0]
    record["ideal"] = servos == ActuatorServos()
    for c, name in enumerate(ActuatorServos.model_fields):
        _fill(record, c, getattr(servos, name), step_us)
    return record


def _fill(record: np.void, c: int, servo: SurfaceServo | EngineServo, step_us: int) -> None:
    if isinstance(servo, SurfaceServo):
        limit, resolution = servo.rate_limit_deg_s, math.radians(servo.resolution_deg)
        record["half_play"][c] = math.radians(servo.backlash_deg) / 2.0
        record["rate_limit"][c] = math.inf if limit is None else math.radians(limit)
    else:
        limit, resolution = servo.rate_limit_n_s, servo.resolution_n
        record["rate_limit"][c] = math.inf if limit is None else limit
    record["resolution"][c] = resolution
    record["lag"][c] = servo.lag_s
    record["dead_steps"][c] = round(servo.dead_time_s * 1e6 / step_us)


def sent_commands(servos: np.ndarray) -> np.ndarray:
    """Return a memory of commands for n aircraft's servos, shape (n, longest delay + 1, 4)."""
    depth = int(servos["dead_steps"].max()) + 1
    return np.zeros((len(servos), depth, N_CHANNELS))


@compiled
def begin_period(
    servos: np.void,
    sent: np.ndarray,
    controls: np.ndarray,
    faults: np.ndarray,
    step: int,
    t: float,
    commanded: bool,
) -> None:
    """Let one aircraft's servos receive the commands that are held over a period.

    The flight begins with servos that have come to rest at their first commands.

    Args:
        servos: Record of dtype `SERVOS`, updated in place.
        sent: Memory of commands, shape (depth, 4), updated in place.
        controls: Aileron, elevator, rudder [rad], thrust [N] as commanded, shape (4,).
        faults: Its faults, dtype `FAULT`, shape (MAX_FAULTS,); a hard-over runs a servo away.
        step: Step at which the period begins.
        t: The same [s].
        commanded: Whether a command has been received since the simulation began.
    """
    if servos["ideal"] == 1:
        healthy = faults[0]["target"] < 0
        for c in range(N_CHANNELS):
            target = controls[c] if healthy else servo_command(controls[c], c, faults, t)
            servos["target"][c] = servos["output"][c] = target
        return
    depth, settled = len(sent), servos["settled"] == 1
    for c in range(N_CHANNELS):
        if not settled:
            sent[:, c] = controls[c]
        sent[step % depth, c] = controls[c]
        received = sent[(step - servos["dead_steps"][c]) % depth, c]
        resolution = servos["resolution"][c]
        servos["target"][c] = _rounded(servo_command(received, c, faults, t), resolution)
        if not settled:
            servos["shaft"][c] = servos["output"][c] = _rounded(received, resolution)
    servos["settled"] = settled or commanded


@compiled
def _rounded(command: float, resolution: float) -> float:
    """Return a command rounded to a resolution; 0: none."""
    return round(command / resolution) * resolution if resolution > 0.0 else command


@compiled
def positions(servos: np.void, elapsed: float) -> Controls:
    """Return the positions of one aircraft's servos, before faults and stops.

    Args:
        servos: Record of dtype `SERVOS`.
        elapsed: Time since the period began, up to its length [s].
    """
    if servos["ideal"] == 1:
        target = servos["target"]
        return target[0], target[1], target[2], target[3]
    return (
        _position(servos, 0, elapsed),
        _position(servos, 1, elapsed),
        _position(servos, 2, elapsed),
        _position(servos, 3, elapsed),
    )


@compiled
def end_period(servos: np.void, dt: float) -> None:
    """Take one aircraft's servos to the end of a period of length dt [s]."""
    if servos["ideal"] == 1:
        return
    for c in range(N_CHANNELS):
        shaft, output = _shaft(servos, c, dt), _position(servos, c, dt)
        servos["shaft"][c], servos["output"][c] = shaft, output


@compiled
def _position(servos: np.void, c: int, elapsed: float) -> float:
    """Return a servo's position behind its play.

    Over a period the shaft moves in one direction, so that the play's other side is not reached
    in between: it is enough to know where both stood when the period began.
    """
    shaft = _shaft(servos, c, elapsed)
    half: float = servos["half_play"][c]
    output: float = servos["output"][c]
    if half == 0.0:
        return shaft
    return clamp(output, shaft - half, shaft + half)


@compiled
def _shaft(servos: np.void, c: int, elapsed: float) -> float:
    """Return the position of a servo's shaft, a time after the start of the period."""
    start, target = servos["shaft"][c], servos["target"][c]
    return lagged(start, target, servos["lag"][c], servos["rate_limit"][c], elapsed)

"""Servos: from the command that the plant holds to the position that the servo has.

In this order: dead time, rounding to the resolution, first-order lag with a limited rate, play.
Faults come after the servo: they act on what the actuator does (`sitl_plant.actuators`), so an
actuator that is stuck at a position is there at once and stays there, and the servo behind it goes
on following its commands.

The target of a servo is constant over a control period, so that the lag with its limit has a
closed solution there; the integration evaluates it at its stages. No control period is too
long for a lag, and no lag too short.
"""

import math

import numpy as np

from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators import Controls
from sitl_plant.hardware import ActuatorServos, EngineServo, SurfaceServo

__all__ = ["SERVO", "begin_period", "end_period", "new_servos", "positions", "sent_commands"]

SERVO = np.dtype(
    [
        ("lag", "f8"),  # s
        ("rate_limit", "f8"),  # rad/s or N/s, inf: none
        ("dead_steps", "i8"),  # control periods
        ("half_play", "f8"),  # rad or N
        ("resolution", "f8"),  # rad or N
        ("settled", "i8"),  # 1: has come to rest at its first command
        ("target", "f8"),  # what it goes to in this period [rad or N]
        ("shaft", "f8"),  # where it stood when the period began, before the play [rad or N]
        ("output", "f8"),  # the same behind the play
    ]
)
"""A servo and its state."""


def new_servos(servos: ActuatorServos, step_us: int) -> np.ndarray:
    """Return the servos of one aircraft, dtype `SERVO`, shape (4,).

    Args:
        servos: Their configuration.
        step_us: Control period [µs].
    """
    row = np.zeros(N_CHANNELS, SERVO)
    for i, name in enumerate(ActuatorServos.model_fields):
        _fill(row[i], getattr(servos, name), step_us)
    return row


def _fill(record: np.void, servo: SurfaceServo | EngineServo, step_us: int) -> None:
    if isinstance(servo, SurfaceServo):
        limit, resolution = servo.rate_limit_deg_s, math.radians(servo.resolution_deg)
        record["half_play"] = math.radians(servo.backlash_deg) / 2.0
        record["rate_limit"] = math.inf if limit is None else math.radians(limit)
    else:
        limit, resolution = servo.rate_limit_n_s, servo.resolution_n
        record["rate_limit"] = math.inf if limit is None else limit
    record["resolution"] = resolution
    record["lag"] = servo.lag_s
    record["dead_steps"] = round(servo.dead_time_s * 1e6 / step_us)


def sent_commands(servos: np.ndarray) -> np.ndarray:
    """Return a memory of commands for n aircraft's servos, shape (n, longest delay + 1, 4)."""
    depth = int(servos["dead_steps"].max()) + 1
    return np.zeros((len(servos), depth, N_CHANNELS))


@compiled
def begin_period(
    servos: np.ndarray, sent: np.ndarray, controls: np.ndarray, step: int, commanded: bool
) -> None:
    """Let one aircraft's servos receive the commands that are held over a period.

    The flight begins with servos that have come to rest at their first commands.

    Args:
        servos: Dtype `SERVO`, shape (4,), updated in place.
        sent: Memory of commands, shape (depth, 4), updated in place.
        controls: Aileron, elevator, rudder [rad], thrust [N] as commanded, shape (4,).
        step: Step at which the period begins.
        commanded: Whether a command has been received since the simulation began.
    """
    depth = len(sent)
    for c in range(N_CHANNELS):
        servo = servos[c]
        settled = servo["settled"] == 1
        if not settled:
            sent[:, c] = controls[c]
        sent[step % depth, c] = controls[c]
        target = sent[(step - servo["dead_steps"]) % depth, c]
        if servo["resolution"] > 0.0:
            target = round(target / servo["resolution"]) * servo["resolution"]
        servo["target"] = target
        if not settled:
            servo["shaft"] = target
            servo["output"] = target
            servo["settled"] = commanded


@compiled
def positions(servos: np.ndarray, elapsed: float) -> Controls:
    """Return where one aircraft's servos stand, before faults and stops.

    Args:
        servos: Dtype `SERVO`, shape (4,).
        elapsed: Time since the period began, up to its length [s].
    """
    return (
        _position(servos[0], elapsed),
        _position(servos[1], elapsed),
        _position(servos[2], elapsed),
        _position(servos[3], elapsed),
    )


@compiled
def end_period(servos: np.ndarray, dt: float) -> None:
    """Take one aircraft's servos to the end of a period of length dt [s]."""
    for c in range(N_CHANNELS):
        servo = servos[c]
        shaft, output = _shaft(servo, dt), _position(servo, dt)
        servo["shaft"], servo["output"] = shaft, output


@compiled
def _position(servo: np.void, elapsed: float) -> float:
    """Return a servo's position behind its play.

    Over a period the shaft moves in one direction, so that the play's other side is not reached
    in between: it is enough to know where both stood when the period began.
    """
    shaft = _shaft(servo, elapsed)
    half: float = servo["half_play"]
    output: float = servo["output"]
    if half == 0.0:
        return shaft
    return min(max(output, shaft - half), shaft + half)


@compiled
def _shaft(servo: np.void, elapsed: float) -> float:
    """Solve lag · ẋ = target - x with |ẋ| ≤ rate limit, from the start of the period.

    While the distance to the target is more than rate limit · lag the servo moves at its limit,
    and then it closes exponentially; the two pieces meet with the same rate.
    """
    target: float = servo["target"]
    start: float = servo["shaft"]
    lag, limit = servo["lag"], servo["rate_limit"]
    if lag == 0.0 and math.isinf(limit):
        return target
    distance = abs(target - start)
    near = limit * lag if lag > 0.0 else 0.0
    running = max(distance - near, 0.0) / limit
    if elapsed < running:
        return start + math.copysign(limit * elapsed, target - start)
    rest = min(distance, near)
    if lag > 0.0:
        rest *= math.exp((running - elapsed) / lag)
    return target - math.copysign(rest, target - start)

"""Event-triggered neighbour messages: extrapolation, which sender and receivers share, and trigger.

A message holds the sender's tracking errors and their rates. From it every receiver, and the
sender itself, extrapolate as if each rate decayed with the time constant τ = 0.1 s::

    x(t) = x(t_k) + τ (1 - exp(-(t - t_k) / τ)) ẋ(t_k)

which is x(t_k) at the time t_k of the message, follows its rate at first, and in the end holds a
value. The next message is sent when one of the sender's errors differs from it by more than
relative · |error| + absolute, or after the longest silence; so without losses that bounds
the receivers' error. After a lost message the next one, which is complete, corrects it.

On a path, it also holds the sender's place on it and in space, which go on with their rates,
and a report on all members of the formation. A message is then also due when a place differs by
more than its threshold, or the report by anything.
"""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.step import SignalsRecord
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE
from mavlink_defs.runtime.jit import compiled

_TAU_S = 0.1
"""Time constant with which rates decay, about the one of the attitude loop [s]."""


@compiled
def refer_to_reference(message: np.void, signals: SignalsRecord) -> None:
    """Turn the own motion in an FTC_NEIGHBOUR payload into tracking errors.

    Args:
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR`, updated in place.
        signals: Of the same step.
    """
    error, reference_dot = signals["error"], signals["reference_dot"]
    message["airspeed"] = error[0]
    message["airspeed_rate"] -= reference_dot[0]
    for k in range(3):
        message["attitude"][k] = error[1 + k]
        message["attitude_rate"][k] -= reference_dot[1 + k]
    message["frame"] = FTC_NEIGHBOUR_FRAME_REFERENCE


@compiled
def extrapolate(message: np.void, step: int, dt: float, result: np.void) -> None:
    """Write what a message says of a later step.

    Args:
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR`.
        step: Step, not before the step of the message; at its own step the result is the message.
        dt: Control period [s].
        result: Payload of the same dtype, written.
    """
    age = np.int64(step) - np.int64(message["step"])  # compiled, unsigned numbers have no sign
    left = math.exp(-dt / _TAU_S * age)
    reach = _TAU_S * (1.0 - left)
    result["airspeed"] = message["airspeed"] + reach * message["airspeed_rate"]
    result["airspeed_rate"] = left * message["airspeed_rate"]
    for k in range(3):
        rate = message["attitude_rate"][k]
        result["attitude"][k] = message["attitude"][k] + reach * rate
        result["attitude_rate"][k] = left * rate
    result["step"] = step
    result["frame"] = message["frame"]
    result["path_id"] = message["path_id"]
    if np.int64(message["path_id"]) != 0:
        _move_on(message, age * dt, result)


@compiled
def _move_on(message: np.void, time: float, result: np.void) -> None:
    """Write what a message says of places a time later [s]; the report stays."""
    result["path_rate"] = message["path_rate"]
    result["path_position"] = message["path_position"] + time * message["path_rate"]
    for k in range(3):
        velocity = message["ground_velocity"][k]
        result["ground_velocity"][k] = velocity
        result["position"][k] = message["position"][k] + time * velocity
    for m in range(len(message["report"])):
        result["report"][m] = message["report"][m]


@compiled
def is_message_due(
    own: np.void, last: np.void, extrapolated: np.void, dt: float, trigger: np.void
) -> bool:
    """Return whether the neighbours need a new message.

    Args:
        own: The present FTC_NEIGHBOUR payload.
        last: The one sent last.
        extrapolated: What the neighbours make of that at the present step, of `extrapolate`.
        dt: Control period [s].
        trigger: Record made of `ftc_autopilot.control.config.FormationTrigger`.
    """
    age = np.int64(own["step"]) - np.int64(last["step"])
    if age <= 0:
        return False
    if age * dt >= trigger["longest_silence_s"] or own["frame"] != last["frame"]:
        return True
    limit = trigger["airspeed_relative"] * abs(own["airspeed"]) + trigger["airspeed_m_s"]
    due = abs(own["airspeed"] - extrapolated["airspeed"]) > limit
    for k in range(3):
        angle = own["attitude"][k]
        limit = trigger["attitude_relative"] * abs(angle) + trigger["attitude_rad"]
        due = due or abs(wrap(angle - extrapolated["attitude"][k])) > limit
    return bool(due or _are_places_due(own, last, extrapolated, trigger))


@compiled
def _are_places_due(own: np.void, last: np.void, extrapolated: np.void, trigger: np.void) -> bool:
    """Return whether the neighbours need to hear of a place, or of the formation's members."""
    if own["path_id"] != last["path_id"]:
        return True
    if np.int64(own["path_id"]) == 0:
        return False
    off = abs(own["path_position"] - extrapolated["path_position"])
    due = off > trigger["path_position_m"]
    for k in range(3):
        due = due or abs(own["position"][k] - extrapolated["position"][k]) > trigger["position_m"]
    for m in range(len(own["report"])):
        due = due or own["report"][m] != last["report"][m]
    return bool(due)

"""Heading by bank: a commanded yaw is reached by turning; yaw follows the direction of flight.

An aircraft without a rudder cannot turn its nose by itself, and one whose side force grows with
sideslip while the rudder holds the heading slips away. Such an aircraft banks. In a coordinated
turn tan φ = V ψ̇/g (Beard, McLain: Small Unmanned Aircraft, 2012), so that the roll
command of the reference is replaced by

    φ_c = atan(V ψ̇_c/g),   ψ̇_c = ψ̇_r + (3/ω) ψ̈_r + k (ψ_r - ψ)

within a limit. It passes the filter (ω/(s+ω))³ of the reference, whose delay 3/ω the second term
leads; the roll loop is faster than that by far. s (1 + s/ω)³ + k then has a double real root at
-ω/4 for k = 27 ω/256: the largest gain without overshoot, which is the default.

The law's yaw reference becomes the direction of flight, ψ + β: its yaw error is -β, and the rudder,
if there is one, coordinates the turn.
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.tuples import replaced
from ftc_autopilot.control.pairing import surfaces_by_sideslip
from ftc_autopilot.control.step import Step
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aerodynamics import lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.vec3 import Vec3, clamp

_MAX_GAIN = 27.0 / 256.0  # without overshoot, relative to the bandwidth of the reference
_YAW = 3  # row of the reference
_MIN_COSINE = 0.3  # of the roll angle, in the turn rate
_ANY_AIRSPEED = 1.0  # m/s; the signs of what is judged do not depend on it


class HeadingLoop(NamedTuple):
    """How a law holds the heading."""

    by_bank: bool
    gain: float  # k [1/s]; 0: the default
    bank_limit: float  # rad


def needs_bank(aircraft: Aircraft) -> str | None:
    """Return why an aircraft has to hold its heading by bank; None if its rudder can hold it.

    Where the rudder balances the yawing moment of sideslip, the side force that is left has to be
    against the sideslip: Y_β - Y_δr n_β/n_δr < 0. Where aileron and rudder are coupled, both
    balance both moments.
    """
    if not aircraft.has("rudder"):
        return "no rudder"
    if not remaining_side_force(aircraft, _ANY_AIRSPEED) < 0.0:
        return "sideslip grows while the rudder holds the heading"
    return None


def remaining_side_force(aircraft: Aircraft, V: float) -> float:
    """Return the side force by sideslip [N/rad] while the rudder holds the heading at V [m/s].

    NaN if the rudder makes no yawing moment.
    """
    side = lateral(V, aircraft_record(aircraft)).side
    aileron, rudder = surfaces_by_sideslip(aircraft)
    return float(side.beta + side.aileron * aileron + side.rudder * rudder)


def weathercock_problem(aircraft: Aircraft) -> str | None:
    """Return why an aircraft without a rudder cannot be flown; None if it can, or has a rudder.

    While the aileron holds the roll angle, sideslip must make a yawing moment against it.
    """
    if aircraft.has("rudder"):
        return None
    air = lateral(_ANY_AIRSPEED, aircraft_record(aircraft))
    roll, yaw = air.rolling, air.yawing
    if roll.aileron != 0.0 and yaw.beta - yaw.aileron * roll.beta / roll.aileron > 0.0:
        return None
    return "it has no rudder, and does not turn into the wind by itself (cn_beta) either"


@compiled
def bank_for(
    motion: MeasuredMotion, filtered: np.ndarray, bandwidth: float, loop: HeadingLoop, g: float
) -> float:
    """Return the roll angle that turns to the heading of the reference [rad].

    Args:
        motion: Own motion.
        filtered: Filtered reference and its two derivatives [m/s, rad], shape (4, 3).
        bandwidth: Of the reference filter [rad/s].
        loop: The heading loop.
        g: Acceleration of gravity [m/s²].
    """
    k = loop.gain if loop.gain > 0.0 else _MAX_GAIN * bandwidth
    rate = filtered[_YAW, 1] + 3.0 / bandwidth * filtered[_YAW, 2]
    rate += k * wrap(filtered[_YAW, 0] - motion.phi[2] - sideslip_of(motion))
    return clamp(math.atan2(motion.V * rate, g), -loop.bank_limit, loop.bank_limit)


@compiled
def sideslip_of(motion: MeasuredMotion) -> float:
    """Return β [rad]."""
    return math.asin(clamp(motion.v[1] / motion.V, -1.0, 1.0))


@inlined
def along_flight(now: Step, g: float) -> Step:
    """Return the step whose yaw reference is the direction of flight, in a coordinated turn.

    Args:
        now: The present step.
        g: Acceleration of gravity [m/s²].
    """
    beta = sideslip_of(now.motion)
    roll, _, yaw = now.motion.phi
    cosine = max(math.cos(roll), _MIN_COSINE)
    turning = g * math.sin(roll) / (cosine * max(now.motion.v[0], 1.0))
    reference, errors = now.reference, now.errors
    reference = replaced(reference, "phi", _with_yaw(reference.phi, yaw + beta))
    reference = replaced(reference, "phi_dot", _with_yaw(reference.phi_dot, turning))
    e_prime = _with_yaw(errors.e_prime, -errors.lambda_omega * beta)
    errors = replaced(errors, "e", _with_yaw(errors.e, -beta))
    errors = replaced(errors, "e_prime", e_prime)
    errors = replaced(errors, "e_dot_sum", _with_yaw(errors.e_dot_sum, 0.0))
    now = replaced(now, "errors", errors)
    now = replaced(now, "by_bank", 1)
    return replaced(now, "reference", reference)


@compiled
def _with_yaw(angles: Vec3, yaw: float) -> Vec3:
    return angles[0], angles[1], yaw

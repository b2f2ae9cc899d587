"""Pitch with the elevator lost: the speed is given up, and the thrust holds the pitch angle."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.laws.base import Instant
from ftc_autopilot.control.laws.surviving.gains import gain_at
from mavlink_defs.constants import ELEVATOR, THROTTLE
from mavlink_defs.runtime.jit import compiled

_ALPHA_MIN, _ALPHA_MAX = -0.1, 0.45  # of a trim [rad]
_GAMMA = 0.5  # largest flight path angle of a trim [rad]
_LEAST_LIFT = 0.03  # lift and drag coefficients together
_SLOW, _FAST = 0.88, 0.8  # of the least and the largest airspeed with gains
_INTEGRATED, _LARGEST_INTEGRAL = 0.35, 0.6  # pitch error [rad], its integral [rad s]


class PitchTrim(NamedTuple):
    """A steady flight with the elevator given."""

    V: float  # airspeed [m/s]
    alpha: float  # angle of attack [rad]
    thrust: float  # at the present airspeed [N]


@compiled
def pitch_trim(now: Instant, aircraft: np.void, gains: np.void, diagnosis: np.void) -> PitchTrim:
    """Return the trim at the reference's pitch angle with the elevator stuck at f.

        α* = -(cm0 + cm_δe f)/cm_α,   γ = θ_r - α*
        L + T sin α = m g cos γ,   T cos α = D + m g sin γ   for V*

    T is that of the present airspeed: a speed error then makes no thrust of its own.
    """
    stuck = diagnosis["actuators"][ELEVATOR]["stuck"]
    alpha = -(aircraft["cm0"] + aircraft["cm_de"] * stuck) / aircraft["cm_alpha"]
    alpha = min(max(alpha, _ALPHA_MIN), _ALPHA_MAX)
    gamma = min(max(now.reference.phi[1] - alpha, -_GAMMA), _GAMMA)
    weight = aircraft["m"] * aircraft["g"]
    lift = aircraft["cL0"] + aircraft["cL_alpha"] * alpha + aircraft["cD0"] * math.tan(alpha)
    carried = weight * (math.cos(gamma) - math.tan(alpha) * math.sin(gamma))
    half_rho_S = 0.5 * aircraft["rho"] * aircraft["S"]
    V = math.sqrt(max(carried, 1.0) / max(lift, _LEAST_LIFT) / half_rho_S)
    airspeeds = gains["airspeeds"]
    V = min(max(V, _SLOW * airspeeds[0]), _FAST * airspeeds[-1])
    drag = half_rho_S * now.motion.V * now.motion.V * aircraft["cD0"]
    return PitchTrim(V, alpha, (drag + weight * math.sin(gamma)) / math.cos(alpha))


@compiled
def thrust_for_pitch(now: Instant, trim: PitchTrim, gains: np.void, state: np.void) -> float:
    """Return the thrust [N] with the elevator lost: T* - K [V - V*, α - α*, q, e_θ, ∫e_θ dt]."""
    motion = now.motion
    alpha = math.atan2(motion.v[2], motion.v[0])
    e = motion.phi[1] - now.reference.phi[1]
    if abs(e) < _INTEGRATED:
        integral = state["pitch_integral"] + now.dt * e
        state["pitch_integral"] = min(max(integral, -_LARGEST_INTEGRAL), _LARGEST_INTEGRAL)
    x = (motion.V - trim.V, alpha - trim.alpha, motion.omega[1], e, state["pitch_integral"])
    thrust: float = trim.thrust - state["diagnosis"]["actuators"][THROTTLE]["offset"]
    for i in range(len(x)):
        thrust -= gain_at(gains["airspeeds"], gains["thrust_gains"], motion.V, i) * x[i]
    return thrust

"""Pitch with the elevator lost: the speed is given up, and the thrust holds the pitch angle."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.laws.surviving.gains import gain_at
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import ELEVATOR, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import balanced_alpha, carried, drag, drag_coefficient
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.thrust import is_short
from sitl_plant.vec3 import clamp

_ALPHA_MIN, _ALPHA_MAX = -0.1, 0.45  # of a trim [rad]
_GAMMA = 0.5  # largest flight path angle of a trim [rad]
_MIN_LIFT = 0.03  # lift and drag coefficients together
_SLOW, _FAST = 0.88, 0.8  # of the least and the largest airspeed with gains
_INTEGRATED = 0.35  # pitch error [rad]
_APPROXIMATIONS = 3  # of a trim that the moment of the thrust moves


class PitchTrim(NamedTuple):
    """A steady flight with the elevator given."""

    V: float  # airspeed [m/s]
    alpha: float  # angle of attack [rad]
    thrust: float  # at the present airspeed [N]


@compiled
def pitch_trim(
    now: Step, aircraft: AircraftRecord, gains: np.void, diagnosis: np.void
) -> PitchTrim:
    """Return the trim at the reference's pitch angle with the elevator stuck at f.

        M(α*, f) + z T = 0,   γ = θ_r - α*
        L + T sin α = m g cos γ,   T cos α = D + m g sin γ   for V*

    The first holds the T of the other two, and z is the arm of the thrust. The T that is returned
    is at the present airspeed: a speed error then makes no thrust of its own.
    """
    stuck = diagnosis["actuators"][ELEVATOR]["stuck"]
    alpha = clamp(balanced_alpha(stuck, aircraft), _ALPHA_MIN, _ALPHA_MAX)
    gamma = clamp(now.reference.phi[1] - alpha, -_GAMMA, _GAMMA)
    if aircraft["thrust_arms"][1] != 0.0:
        for _ in range(_APPROXIMATIONS):
            by_thrust = _thrust_coefficient(alpha, gamma, aircraft) * aircraft["thrust_arms"][1]
            balanced = balanced_alpha(stuck, aircraft, by_thrust / aircraft["c_bar"])
            alpha = clamp(balanced, _ALPHA_MIN, _ALPHA_MAX)
            gamma = clamp(now.reference.phi[1] - alpha, -_GAMMA, _GAMMA)
    weight = aircraft["m"] * aircraft["g"]
    lift = carried(alpha, aircraft)
    load = weight * (math.cos(gamma) - math.tan(alpha) * math.sin(gamma))
    half_rho_S = 0.5 * aircraft["rho"] * aircraft["S"]
    V = math.sqrt(max(load, 1.0) / max(lift, _MIN_LIFT) / half_rho_S)
    airspeeds = gains["airspeeds"]
    V = clamp(V, _SLOW * airspeeds[0], _FAST * airspeeds[-1])
    D = drag(half_rho_S * now.motion.V * now.motion.V, alpha, aircraft)
    return PitchTrim(V, alpha, (D + weight * math.sin(gamma)) / math.cos(alpha))


@compiled
def _thrust_coefficient(alpha: float, gamma: float, aircraft: AircraftRecord) -> float:
    """Return T/(q S) of a steady flight: (C_D + C_W sin γ)/cos α, with C_W the weight by q S."""
    lift = max(carried(alpha, aircraft), _MIN_LIFT)
    weight = lift / (math.cos(gamma) - math.tan(alpha) * math.sin(gamma))
    return (drag_coefficient(alpha, aircraft) + weight * math.sin(gamma)) / math.cos(alpha)


@compiled
def thrust_for_pitch(
    now: Step, trim: PitchTrim, aircraft: AircraftRecord, gains: np.void, state: np.void
) -> float:
    """Return the thrust [N] with the elevator lost: T* - K [V - V*, α - α*, q, e_θ, ∫e_θ dt].

    The integral stands still while the propulsion cannot make the thrust that it asks for.
    """
    motion = now.motion
    alpha = math.atan2(motion.v[2], motion.v[0])
    e = motion.phi[1] - now.reference.phi[1]
    before = state["pitch_integral"]
    if abs(e) < _INTEGRATED:
        integral, largest = (
            state["pitch_integral"] + now.dt * e,
            gains["pitch_integral_limit_rad_s"],
        )
        state["pitch_integral"] = clamp(integral, -largest, largest)
    x = (motion.V - trim.V, alpha - trim.alpha, motion.omega[1], e, state["pitch_integral"])
    thrust: float = trim.thrust - state["diagnosis"]["actuators"][THROTTLE]["offset"]
    for i in range(len(x)):
        thrust -= gain_at(gains["airspeeds"], gains["thrust_gains"], motion.V, i) * x[i]
    gain = gain_at(gains["airspeeds"], gains["thrust_gains"], motion.V, len(x) - 1)
    grows = gain * (state["pitch_integral"] - before) < 0.0
    if grows and is_short(thrust, motion.V, aircraft):
        state["pitch_integral"] = before
    return thrust

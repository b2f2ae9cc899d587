"""Linear-quadratic gains of the reconfigured loops, computed from the nominal aircraft.

Without the aileron, the rudder alone holds sideslip, roll rate, yaw rate and roll angle; without
the elevator, the thrust alone holds airspeed, angle of attack, pitch rate, pitch angle and its
integral. Both models are linearised about straight, level flight at several airspeeds:
u = u* - K (x - x*), with K from the algebraic Riccati equation.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import carried, lateral, longitudinal
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.vec3 import clamp

AIRSPEEDS = 6
"""Airspeeds at which gains are computed."""
LATERAL = 4
"""States β, p, r, φ [rad, rad/s]; the command is the rudder [rad]."""
LONGITUDINAL = 5
"""States V [m/s], α [rad], q [rad/s], θ [rad], its integral [rad s]; the command is thrust [N]."""

_MIN_AIRSPEED = 1.25  # times the aircraft's lowest airspeed
_DIGITS = 9  # significant; further ones depend on the linear algebra library
_ALPHA = (-0.5, 0.7)  # angles of attack among which level flight is searched [rad]
_WORST_CONDITION = 1e8  # of real aircraft 1e4; beyond this rounding makes the solution
_HALVINGS = 60  # of that interval: to the last digit


class LoopWeights(Model):
    """Weights of the cost that the gains minimise; each of a square, beside the rudder's [rad²].

    Attributes:
        roll_rate_s2: Rudder: roll rate.
        roll: Rudder: roll angle.
        speed_s2_m2: Thrust: airspeed.
        pitch_rate_s2: Thrust: pitch rate.
        pitch: Thrust: pitch angle.
        pitch_integral_1_s2: Thrust: its integral.
        thrust_1_n2: Thrust: itself.
    """

    roll_rate_s2: float = quantity("s^2", default=0.02, ge=0.0)
    roll: float = quantity("", default=4.0, gt=0.0)
    speed_s2_m2: float = quantity("s^2/m^2", default=5e-4, gt=0.0)
    pitch_rate_s2: float = quantity("s^2", default=0.02, ge=0.0)
    pitch: float = quantity("", default=6.0, gt=0.0)
    pitch_integral_1_s2: float = quantity("1/s^2", default=4.0, gt=0.0)
    thrust_1_n2: float = quantity("1/N^2", default=1e-6, gt=0.0)


_DEFAULT = LoopWeights()


class Gains(NamedTuple):
    """Gains by airspeed."""

    airspeeds: np.ndarray  # (AIRSPEEDS,) [m/s]
    rudder: np.ndarray  # (AIRSPEEDS, LATERAL)
    thrust: np.ndarray  # (AIRSPEEDS, LONGITUDINAL)


@lru_cache
def gains_of(aircraft: Aircraft, weights: LoopWeights = _DEFAULT) -> Gains:
    """Return the gains of an aircraft; a formation of equal aircraft computes them once."""
    airspeeds = airspeeds_of(aircraft)
    no_gain = np.zeros(LATERAL)  # of a rudder that is not there
    lateral = [
        lateral_gain(aircraft, V, weights) if aircraft.has("rudder") else no_gain for V in airspeeds
    ]
    longitudinal = [longitudinal_gain(aircraft, V, weights) for V in airspeeds]
    return Gains(airspeeds, np.array(lateral), np.array(longitudinal))


def airspeeds_of(aircraft: Aircraft) -> np.ndarray:
    """Return the airspeeds at which gains are computed [m/s], shape (AIRSPEEDS,)."""
    return np.linspace(
        _MIN_AIRSPEED * aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s, AIRSPEEDS
    )


def lateral_gain(aircraft: Aircraft, V: float, weights: LoopWeights = _DEFAULT) -> np.ndarray:
    """Return the rudder's gains at an airspeed V [m/s], shape (LATERAL,).

    The model is straight, level flight without sideslip.
    """
    a = aircraft_record(aircraft)
    air = lateral(V, a)
    rolling, yawing = ([c.beta, c.p, c.r, 0.0, c.rudder] for c in (air.rolling, air.yawing))
    p_dot, _, r_dot = a["J_inv"] @ (air.scale * np.array([rolling, [0.0] * 5, yawing]))
    side, momentum = air.side, a["m"] * V
    beta_dot = np.array(
        [
            side.beta / momentum,
            side.p / momentum,
            side.r / momentum - 1.0,
            a["g"] / V,
            side.rudder / momentum,
        ]
    )
    phi_dot = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
    model = np.array([beta_dot, p_dot, r_dot, phi_dot])
    Q = np.diag([0.0, weights.roll_rate_s2, 0.0, weights.roll])
    return riccati(model, Q, 1.0)


def longitudinal_gain(aircraft: Aircraft, V: float, weights: LoopWeights = _DEFAULT) -> np.ndarray:
    """Return the thrust's gains at an airspeed V [m/s], shape (LONGITUDINAL,) [N per unit].

    The model is straight, level flight, and the elevator stands where it trims that:

        V̇ = (T cos α - D_α α)/m - g sin(θ - α)
        α̇ = q - (L_α α + L_q q + T sin α)/(m V) + g cos(θ - α)/V
        q̇ = (M_α α + M_q q + z T + ...)/Jyy,   θ̇ = q
    """
    a = aircraft_record(aircraft)
    m, g, J = a["m"], a["g"], a["J"][1, 1]
    alpha = _level_alpha(a, V)
    air = longitudinal(V, alpha, a)
    T = air.drag / math.cos(alpha)
    along, across = m * V, m * V * V
    V_by_alpha = g - (T * math.sin(alpha) + air.drag_by_alpha) / m
    alpha_by_V = -2.0 * (m * g - T * math.sin(alpha)) / across  # L = m g - T sin α
    alpha_by_alpha = -(air.lift_by_alpha + T * math.cos(alpha)) / along
    arm = a["thrust_arms"][1]
    moment_by_V = 0.0 - 2.0 * arm * T / V  # of the air, which balances the thrust
    model = np.array(
        [
            [-2.0 * air.drag / along, V_by_alpha, 0.0, -g, 0.0],
            [alpha_by_V, alpha_by_alpha, 1.0 - air.lift_by_q / along, 0.0, 0.0],
            [moment_by_V / J, air.moment_by_alpha / J, air.moment_by_q / J, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0],
        ]
    )
    by_thrust = np.array([math.cos(alpha) / m, -math.sin(alpha) / along, arm / J, 0.0, 0.0])
    Q = np.diag(
        [
            weights.speed_s2_m2,
            0.0,
            weights.pitch_rate_s2,
            weights.pitch,
            weights.pitch_integral_1_s2,
        ]
    )
    return riccati(np.column_stack([model, by_thrust]), Q, weights.thrust_1_n2)


def _level_alpha(a: np.void, V: float) -> float:
    """Return α [rad] of level flight, whose lift and thrust carry m g; the nearest to it."""
    qS = 0.5 * a["rho"] * V * V * a["S"]

    def excess(alpha: float) -> float:
        return float(qS * carried(alpha, a) - a["m"] * a["g"])

    low, high = _ALPHA
    if excess(low) >= 0.0:
        return low
    if excess(high) <= 0.0:
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return high


def riccati(model: np.ndarray, Q: np.ndarray, R: float) -> np.ndarray:
    """Return the gains of ẋ = A x + B u for the cost xᵀQx + R u²; `model` is [A B].

    P solves the Riccati equation if the stable vectors of its Hamiltonian matrix are [U, P U].

    Raises:
        numpy.linalg.LinAlgError: No gains hold this model.
    """
    A, B = model[:, :-1], model[:, -1:]
    n = len(A)
    values, vectors = np.linalg.eig(np.block([[A, -B @ B.T / R], [-Q, -A.T]]))
    stable = vectors[:, values.real < 0.0]
    if stable.shape[1] != n or np.linalg.cond(stable[:n]) > _WORST_CONDITION:
        raise np.linalg.LinAlgError("the Riccati equation has no stabilising solution")
    P = np.linalg.solve(stable[:n].T, stable[n:].T).T.real
    gains = (B.T @ P)[0] / R
    return np.array([float(f"{gain:.{_DIGITS}g}") for gain in gains])


@compiled
def gain_at(airspeeds: np.ndarray, gains: np.ndarray, V: float, i: int) -> float:
    """Return gain i at an airspeed V [m/s], linear in between, constant beyond the ends.

    Args:
        airspeeds: Increasing by equal steps [m/s], shape (n,).
        gains: Shape (n, states).
        V: Airspeed [m/s].
        i: State.
    """
    last = len(airspeeds) - 1
    place = (V - airspeeds[0]) / (airspeeds[1] - airspeeds[0])
    place = clamp(place, 0.0, float(last))
    k = min(int(place), last - 1)
    share = place - k
    gain: float = (1.0 - share) * gains[k, i] + share * gains[k + 1, i]
    return gain

"""Adaptation: the strength of aileron and elevator, and the damping of pitch, from the flight.

The moment that the nominal aircraft does not explain, as the diagnosis measures it, is a
disturbance and the errors θ of the derivatives, relative to the nominal ones:

    y_i = θ_i1 x_i1 + θ_i2 x_i2 + d_i

with x_1 the nominal angular acceleration by damping and x_2 that by the axis' own surface. The
commands are steps, the disturbance is slow and the gyro's noise fast: a band-pass filter keeps d_i
from being taken for an error of the surface that counteracts it. θ is the regularised least-squares
solution with exponential forgetting, and Huber's weights against faults. The damping of roll is
estimated so that its error is not taken for one of the aileron, but not used; yaw is left alone.
Neither costs messages, and adapting them does in a narrow tube.
"""

import math

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.airframe.aerodynamics import correct_derivatives, rate_damping
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import Vec3, clamp, mul

AXES = 2
"""Roll and pitch."""
DERIVATIVES = 2
"""Of each axis: damping, and by its own surface."""

_REST = DERIVATIVES  # column of what the nominal aircraft does not explain
_SETTLED = 4.0  # filters of the diagnosis, in their time constants, before anything is learnt
MAX_ERROR = 0.4
"""Of a derivative, relative."""


@inlined
def adapt(now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void) -> None:
    """Learn from the last check period, and write the adapted aircraft to `state["model"]`.

    Nothing is learnt while a surface is suspect or lost: it does not do what it is commanded.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Tube`.
        state: Record of dtype `Tube.STATE`, updated in place.
    """
    if now.first:
        copy_record(state["model"], aircraft)
    diagnosis = state["fallback"]["diagnosis"]
    settled = diagnosis["age"] - _SETTLED * gains["fallback"]["diagnosis"]["filter_s"]
    if gains["adapt"] == 0 or settled < 0.0:
        return
    period = gains["check_s"]
    signals = np.empty((AXES, DERIVATIVES + 1))
    _explain(now.motion, aircraft, diagnosis, signals)
    smooth_s, slow_s = gains["adaptation_smooth_s"], gains["adaptation_slow_s"]
    _band_pass(signals, state["means"], period, smooth_s, slow_s, settled < period)
    for j in range(THROTTLE):
        actuator = diagnosis["actuators"][j]
        if actuator["lost"] != 0 or actuator["suspect_s"] > 0.0:
            return
    keep = math.exp(-period / gains["adaptation_memory_s"])
    large = gains["adaptation_residual_rad_s2"]
    for i in range(AXES):
        x, y, theta = signals[i], signals[i, _REST], state["derivative_error"][i]
        residual = abs(y - theta[0] * x[0] - theta[1] * x[1])
        weight = period * min(1.0, large / max(residual, large))
        G, g = state["information"][i], state["evidence"][i]
        for k in range(DERIVATIVES):
            for n in range(DERIVATIVES):
                G[k, n] = keep * G[k, n] + weight * x[k] * x[n]
            g[k] = keep * g[k] + weight * x[k] * y
        a, b, c = G[0, 0] + gains["adaptation_prior"], G[0, 1], G[1, 1] + gains["adaptation_prior"]
        determinant = a * c - b * b
        found = (c * g[0] - b * g[1]) / determinant, (a * g[1] - b * g[0]) / determinant
        for k in range(DERIVATIVES):
            theta[k] = clamp(found[k], -MAX_ERROR, MAX_ERROR)
    error = state["derivative_error"]
    correct_derivatives(aircraft, error[0, 1], error[1, 0], error[1, 1], state["model"])


@inlined
def _explain(
    motion: MeasuredMotion, aircraft: AircraftRecord, diagnosis: np.void, signals: np.ndarray
) -> None:
    """Write nominal angular accelerations by damping and by the own surface, and what is left.

    All have passed the filter of the diagnosis.

    Args:
        motion: Own motion.
        aircraft: Nominal aircraft.
        diagnosis: State of the diagnosis.
        signals: Written [rad/s²], shape (2, 3): x_1, x_2, y of roll and pitch.
    """
    C, omega = motion.air.C, diagnosis["omega_filtered"]
    damping = rate_damping(motion.V, aircraft)
    one, two, three = (
        diagnosis["actuators"][0],
        diagnosis["actuators"][1],
        diagnosis["actuators"][2],
    )
    u: Vec3 = one["commanded"], two["commanded"], three["commanded"]
    y: Vec3 = one["measured"], two["measured"], three["measured"]
    rest = mul(C, (y[0] - u[0], y[1] - u[1], y[2] - u[2]))
    for i in range(AXES):
        J = aircraft["J"][i, i]
        signals[i, 0] = damping[i] * omega[i] / J
        signals[i, 1] = C[i][i] * u[i] / J
        signals[i, _REST] = rest[i] / J


@compiled
def _band_pass(
    signals: np.ndarray,
    means: np.ndarray,
    period: float,
    smooth_s: float,
    slow_s: float,
    first: bool,
) -> None:
    """Smooth the signals, and subtract slower means twice.

    Args:
        signals: Filtered in place, shape (2, 3).
        means: Of the three stages, updated in place, shape (3, 2, 3).
        period: Since the last call [s].
        smooth_s: Memory of the first stage, a low pass [s].
        slow_s: Memory of the two means [s].
        first: Whether the means begin with the present values.
    """
    for stage in range(3):
        share = 1.0 - math.exp(-period / (smooth_s if stage == 0 else slow_s))
        for i in range(AXES):
            for k in range(DERIVATIVES + 1):
                mean = means[stage, i, k]
                mean = signals[i, k] if first else mean + share * (signals[i, k] - mean)
                means[stage, i, k] = mean
                signals[i, k] = mean if stage == 0 else signals[i, k] - mean

"""Measurement of what each actuator does, beside what it is commanded.

The rates' derivative is never formed. Euler's equation (4), J ω̇ = C δ + N - ω × Jω, is passed
through 1/(τs + 1), which turns J ω̇ into J (ω - ω_f)/τ with ω_f the filtered rates:

    y = C0⁻¹ [J0 (ω - ω_f)/τ + h_f],   h = ω × J0 ω - N0

C0 is square, so every surface has a measurement of its own. The thrust's follows from V̇:

    y_T = m (V̇ - vᵀ(R1ᵀg + F0/m)/V) V/v_x

Commands pass through a model of the servos and the same filter, so that y = u while all is
well. All filters start at rest together with the law, and the servos at their first commands.
"""

import math

import numpy as np

from ftc_autopilot.control.inversion import surfaces_for, thrust_for
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.aircraft import AircraftRecord
from sitl_plant.vec3 import add, clamp, cross, mat3, mul, scale, sub, vec3


@compiled
def servo_step(position: float, command: float, lag_s: float, limit: float, dt: float) -> float:
    """Return the position of a servo after a period; lag 0: no lag, limit in units per second."""
    change = command - position
    if lag_s > 0.0:
        change *= 1.0 - math.exp(-dt / lag_s)
    return position + clamp(change, -limit * dt, limit * dt)


@inlined
def measure(now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void) -> None:
    """Advance the filters; write `position`, `commanded` and `measured` of every actuator.

    Args:
        now: The present step; in the law's first one the filters start.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`, updated in place.
    """
    motion, dt, held = now.motion, now.dt, now.held
    omega_filtered, moment_filtered = state["omega_filtered"], state["moment_filtered"]
    if now.first:
        for i in range(3):
            omega_filtered[i] = motion.omega[i]
        return
    settled = state["age"] > 1.5 * dt
    tau = gains["filter_s"]
    share = dt / tau
    J = mat3(aircraft["J"])
    change = sub(motion.omega, vec3(omega_filtered))
    moment = sub(cross(motion.omega, mul(J, motion.omega)), motion.air.N)
    for i in range(3):
        omega_filtered[i] += share * change[i]
        moment_filtered[i] += share * (moment[i] - moment_filtered[i])
    turning = mul(J, scale(1.0 / tau, change))
    y = surfaces_for(add(turning, vec3(moment_filtered)), motion.air.C)
    actuators = state["actuators"]
    for j in range(N_CHANNELS):
        actuator = actuators[j]
        if j == THROTTLE:
            lag, limit = gains["throttle_lag_s"], math.inf
        else:
            lag, limit = gains["servo_lag_s"], gains["servo_rate_limit_rad_s"]
            actuator["measured"] = y[j]
        if settled:
            actuator["position"] = servo_step(actuator["position"], held[j], lag, limit, dt)
        else:
            actuator["position"] = held[j]
        actuator["commanded"] += share * (actuator["position"] - actuator["commanded"])
    throttle = actuators[THROTTLE]
    thrust = thrust_for(motion.V_dot, motion, aircraft)
    throttle["measured"] += share * (thrust - throttle["measured"])

"""Disturbance observer: what the nominal aircraft does not explain of the measured motion.

Model error, faults and disturbances are lumped into an acceleration d_v and an angular
acceleration d_ω, each with its slope. The accelerometer measures d_v but for its noise; the
angular acceleration is not measured, so a Luenberger observer with a triple pole finds d_ω from
the gyro, and with it the angular velocity without most of the gyro's noise.
"""

import numpy as np

from ftc_autopilot.control.step import Step
from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import inlined
from sitl_plant.airframe.aerodynamics import aerodynamics, force, moment
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import angular_acceleration
from sitl_plant.airframe.thrust import made_thrust, thrust_moment
from sitl_plant.vec3 import add, mat3, vec3


@inlined
def observe(
    now: Step, positions: np.ndarray, aircraft: AircraftRecord, gains: np.void, state: np.void
) -> None:
    """Advance the estimates of d_v, d_ω, their slopes, and ω by one period.

    With τ the memory, the innovations i and the poles 1/2τ (twice) and 1/τ (thrice):

        d_v  += dt (d_v' + i/τ),    d_v' += dt i/(4τ²),    i = f - (F0 + T e_x)/m - d_v
        ω̂    += dt (ω̇_0 + d_ω + 3 i/τ),    i = ω - (ω̂ + dt (ω̇_0 + d_ω))
        d_ω  += dt (d_ω' + 3 i/τ²),   d_ω' += dt i/τ³

    Args:
        now: The present step.
        positions: Of aileron, elevator, rudder [rad] and throttle [N], shape (4,).
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Tube`.
        state: Record of dtype `Tube.STATE`, updated in place.
    """
    motion, dt = now.motion, now.dt
    d, slope, omega = state["disturbance"], state["disturbance_slope"], state["omega"]
    if now.first:
        for i in range(3):
            omega[i] = motion.omega[i]
            state["v"][i] = motion.v[i]
        return
    tau, m = gains["force_observer_s"], aircraft["m"]
    by_air = force(motion.air, vec3(positions))
    thrust = made_thrust(positions[THROTTLE], motion.V, aircraft)
    known_force = by_air[0] + thrust, by_air[1], by_air[2]
    for i in range(3):
        innovation = motion.specific_force[i] - known_force[i] / m - d[i]
        slope[i] += dt * innovation / (4.0 * tau * tau)
        d[i] += dt * slope[i] + min(dt / tau, 0.5) * innovation

    before = vec3(omega)
    air = aerodynamics(vec3(state["v"]), before, aircraft)
    thrust = made_thrust(positions[THROTTLE], air.V, aircraft)
    turning = add(moment(air, vec3(positions)), thrust_moment(thrust, aircraft))
    known = angular_acceleration(before, turning, mat3(aircraft["J"]), mat3(aircraft["J_inv"]))
    pole = 1.0 / gains["rates_observer_s"]
    for i in range(3):
        j = 3 + i
        predicted = before[i] + dt * (known[i] + d[j])
        innovation = motion.omega[i] - predicted
        omega[i] = predicted + min(3.0 * pole * dt, 1.0) * innovation
        d[j] += dt * (slope[j] + 3.0 * pole * pole * innovation)
        slope[j] += dt * pole * pole * pole * innovation
        state["v"][i] = motion.v[i]

"""Rigid-body motion, eqs. (1) to (6) of the paper, and its integration.

Flat, non-rotating Earth; Euler angles 3-2-1, singular at a pitch angle of ±90°.
"""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aerodynamics import (
    Aerodynamics,
    Flow,
    aerodynamics_in,
    flow_of,
    force,
    moment,
)
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.thrust import made_thrust, thrust_moment
from sitl_plant.vec3 import Mat3, Vec3, add, cross, mat3, mul, scale, sub, vec3

State: TypeAlias = tuple[Vec3, Vec3, Vec3, Vec3]
"""Position NED [m], velocity body [m/s], roll-pitch-yaw [rad], angular velocity body [rad/s];
of a derivative, the same per second."""

Air: TypeAlias = tuple[Vec3, Vec3]
"""Velocity [m/s] and angular velocity [rad/s] of the air around an aircraft, body axes."""

STILL_AIR: Air = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@compiled
def load_state(x: np.ndarray) -> State:
    """Read a state from an array of shape (12,), in the order of `State`."""
    return vec3(x[0:3]), vec3(x[3:6]), vec3(x[6:9]), vec3(x[9:12])


@compiled
def store_state(state: State, x: np.ndarray) -> None:
    """Write a state to an array of shape (12,), in the order of `State`."""
    for i in range(3):
        x[i] = state[0][i]
        x[3 + i] = state[1][i]
        x[6 + i] = state[2][i]
        x[9 + i] = state[3][i]


@compiled
def R1(phi: Vec3) -> Mat3:
    """Return the rotation from body to NED axes, eq. (6); roll, pitch, yaw in rad."""
    cf, sf = math.cos(phi[0]), math.sin(phi[0])
    ct, st = math.cos(phi[1]), math.sin(phi[1])
    cp, sp = math.cos(phi[2]), math.sin(phi[2])
    return (
        (cp * ct, -sp * cf + cp * st * sf, sp * sf + cp * st * cf),
        (sp * ct, cp * cf + sp * st * sf, -cp * sf + sp * st * cf),
        (-st, ct * sf, ct * cf),
    )


@compiled
def R2(phi: Vec3) -> Mat3:
    """Return the matrix from Euler angle rates to body rates, eq. (6), misprint put right."""
    cf, sf = math.cos(phi[0]), math.sin(phi[0])
    ct, st = math.cos(phi[1]), math.sin(phi[1])
    return (1.0, 0.0, -st), (0.0, cf, sf * ct), (0.0, -sf, cf * ct)


@compiled
def R2_inv(phi: Vec3) -> Mat3:
    """Return the inverse of `R2`; singular at a pitch angle of ±90°."""
    cf, sf = math.cos(phi[0]), math.sin(phi[0])
    ct, tt = math.cos(phi[1]), math.tan(phi[1])
    return (1.0, sf * tt, cf * tt), (0.0, cf, -sf), (0.0, sf / ct, cf / ct)


@compiled
def gravity_body(phi: Vec3, g: float) -> Vec3:
    """Return gravity in body axes, R1ᵀ [0, 0, g], in the unit of g; yaw does not matter."""
    cf, sf = math.cos(phi[0]), math.sin(phi[0])
    ct, st = math.cos(phi[1]), math.sin(phi[1])
    return -st * g, ct * sf * g, ct * cf * g


@compiled
def angular_acceleration(omega: Vec3, moment: Vec3, J: Mat3, J_inv: Mat3) -> Vec3:
    """Evaluate Euler's equation, (4): J⁻¹ (-ω × Jω + moment) [rad/s²], body axes.

    Args:
        omega: Angular velocity [rad/s].
        moment: Sum of moments about the centre of gravity [N m].
        J: Inertia [kg m²].
        J_inv: Its inverse.
    """
    return mul(J_inv, sub(moment, cross(omega, mul(J, omega))))


@compiled
def specific_force(air: Aerodynamics, delta: Vec3, thrust: float, aircraft: AircraftRecord) -> Vec3:
    """Return the specific force of the air and the propulsion, body axes [m/s²].

    Args:
        air: Forces of the air.
        delta: Deflections of aileron, elevator, rudder [rad].
        thrust: Thrust [N], which is made as far as the airspeed permits.
        aircraft: The aircraft.
    """
    by_air, made = force(air, delta), made_thrust(thrust, air.V, aircraft)
    return scale(1.0 / aircraft["m"], (by_air[0] + made, by_air[1], by_air[2]))


@inlined
def state_derivative(
    state: State,
    thrust: float,
    delta: Vec3,
    d_v: Vec3,
    d_omega: Vec3,
    surrounding: Air,
    aircraft: AircraftRecord,
) -> State:
    """Return the right-hand side of eqs. (1) to (4).

    Args:
        state: Present state.
        thrust: Applied thrust T_x [N], which is made as far as the airspeed permits.
        delta: Applied aileron, elevator, rudder deflections [rad].
        d_v: Disturbance of the acceleration, body axes [m/s²].
        d_omega: Disturbance of the angular acceleration, body axes [rad/s²].
        surrounding: Motion of the air: forces and moments follow from the motion through it.
        aircraft: The aircraft.
    """
    flow = flow_of(sub(state[1], surrounding[0]))
    return derivative_in(flow, state, thrust, delta, d_v, d_omega, surrounding[1], aircraft)


@inlined
def derivative_in(
    flow: Flow,
    state: State,
    thrust: float,
    delta: Vec3,
    d_v: Vec3,
    d_omega: Vec3,
    turning_air: Vec3,
    aircraft: AircraftRecord,
) -> State:
    """Return the same for a flow that is known, and air with an angular velocity [rad/s]."""
    _, v, phi, omega = state
    air = aerodynamics_in(flow, sub(omega, turning_air), aircraft)
    specific = specific_force(air, delta, thrust, aircraft)
    gravity = gravity_body(phi, aircraft["g"])
    made = made_thrust(thrust, air.V, aircraft)
    turning = add(moment(air, delta), thrust_moment(made, aircraft))

    p_dot = mul(R1(phi), v)  # (1)
    v_dot = add(add(sub(specific, cross(omega, v)), gravity), d_v)  # (2)
    phi_dot = mul(R2_inv(phi), omega)  # (3)
    omega_dot = add(
        angular_acceleration(omega, turning, mat3(aircraft["J"]), mat3(aircraft["J_inv"])), d_omega
    )  # (4)
    return p_dot, v_dot, phi_dot, omega_dot


@inlined
def advance(state: State, h: float, derivative: State) -> State:
    """Return state + h · derivative: one explicit Euler step, the building block of RK4; h in s."""
    return (
        add(state[0], scale(h, derivative[0])),
        add(state[1], scale(h, derivative[1])),
        add(state[2], scale(h, derivative[2])),
        add(state[3], scale(h, derivative[3])),
    )

"""The own aircraft's motion, as measured and as the nominal model sees it."""

from typing import NamedTuple

import numpy as np

from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_ABSOLUTE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aerodynamics import Aerodynamics, aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import R2_inv, gravity_body
from sitl_plant.airframe.thrust import made_thrust, thrust_moment
from sitl_plant.vec3 import Vec3, add, dot, mul, sub, vec3

_LEAST_M_S = 0.1
"""Airspeed below which it does not count as one [m/s]."""


class MeasuredMotion(NamedTuple):
    """Measured motion, and the nominal model's view of the air."""

    v: Vec3  # velocity through the air, body axes [m/s]
    phi: Vec3  # roll, pitch, yaw [rad]
    omega: Vec3  # angular velocity, body axes [rad/s]
    V: float  # airspeed [m/s]
    V_dot: float  # from the accelerometer [m/s²]
    specific_force: Vec3  # body axes [m/s²]
    gravity: Vec3  # R1ᵀ g, body axes [m/s²]
    air: Aerodynamics  # nominal force F0, moment N0 with the propulsion's, control matrix C0
    by_thrust: Vec3 = (0.0, 0.0, 0.0)  # the propulsion's part of N0 [N m]


@inlined
def motion_of(measured: np.void, aircraft: AircraftRecord, thrust: float = 0.0) -> MeasuredMotion:
    """Read an FTC_SIM_STATE payload.

    Args:
        measured: Payload of dtype `mavlink_defs.framing.codec.SIM_STATE`.
        aircraft: Nominal aircraft.
        thrust: The thrust that the propulsion is taken to make, if the airspeed permits [N].
    """
    v = sub(vec3(measured["velocity"]), vec3(measured["wind"]))
    phi = vec3(measured["attitude"])
    omega = vec3(measured["rates"])
    air = aerodynamics(v, omega, aircraft)
    by_thrust = thrust_moment(made_thrust(thrust, air.V, aircraft), aircraft)
    air = Aerodynamics(air.V, air.F, add(air.N, by_thrust), air.C, air.B, air.D)
    gravity = gravity_body(phi, aircraft["g"])
    force = vec3(measured["specific_force"])
    V_dot = dot(v, add(force, gravity)) / max(air.V, _LEAST_M_S)
    return MeasuredMotion(
        v=v,
        phi=phi,
        omega=omega,
        V=air.V,
        V_dot=V_dot,
        specific_force=force,
        gravity=gravity,
        air=air,
        by_thrust=by_thrust,
    )


@compiled
def fill_neighbour_state(motion: MeasuredMotion, step: int, message: np.void) -> None:
    """Fill an FTC_NEIGHBOUR payload with the own motion, without a place.

    Args:
        motion: Own motion.
        step: Step number that it belongs to.
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR`.
    """
    rates = mul(R2_inv(motion.phi), motion.omega)
    message["step"] = step
    message["frame"] = FTC_NEIGHBOUR_FRAME_ABSOLUTE
    message["airspeed"] = motion.V
    message["airspeed_rate"] = motion.V_dot
    for i in range(3):
        message["attitude"][i] = motion.phi[i]
        message["attitude_rate"][i] = rates[i]
    if np.int64(message["path_id"]) != 0:
        message["path_id"], message["path_position"], message["path_rate"] = 0, 0.0, 0.0
        for i in range(3):
            message["position"][i], message["ground_velocity"][i] = 0.0, 0.0
        for m in range(len(message["report"])):
            message["report"][m] = 0
        for r in range(len(message["relayed"])):
            message["relayed"][r], message["relayed_step"][r] = 0, 0
        for k in range(len(message["relayed_position"])):
            message["relayed_position"][k], message["relayed_velocity"][k] = 0.0, 0.0

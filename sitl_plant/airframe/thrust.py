"""Thrust: the largest one at an airspeed, what is made of one that is asked for, its moments.

Plant, nominal model, laws, guidance and the tools of `gcs` all ask here. An aircraft whose file
says nothing of its propulsion makes any thrust up to its limit, at any airspeed, without moments.
"""

from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.stops import range_of
from sitl_plant.vec3 import Vec3, scale


@compiled
def available_thrust(V: float, aircraft: AircraftRecord) -> float:
    """Return the largest thrust [N] at an airspeed V [m/s].

    It is linear between the rows of the aircraft's table, constant beyond its ends, and never more
    than the aircraft's limit.
    """
    limit: float = aircraft["thrust_limit"]
    rows = aircraft["thrust_rows"]
    if rows == 0:
        return limit
    airspeeds, thrusts = aircraft["thrust_airspeeds"], aircraft["thrust_most"]
    most: float = thrusts[0]
    if airspeeds[rows - 1] <= V:
        most = thrusts[rows - 1]
    elif airspeeds[0] < V:
        k = 1
        while airspeeds[k] < V:
            k += 1
        share = (V - airspeeds[k - 1]) / (airspeeds[k] - airspeeds[k - 1])
        most = thrusts[k - 1] + share * (thrusts[k] - thrusts[k - 1])
    return min(most, limit)


@compiled
def is_short(thrust: float, V: float, aircraft: AircraftRecord) -> bool:
    """Return whether the airspeed V [m/s] is too high for a thrust that is asked for [N]."""
    return bool(aircraft["thrust_rows"] > 0 and thrust > available_thrust(V, aircraft))


@compiled
def made_thrust(thrust: float, V: float, aircraft: AircraftRecord) -> float:
    """Return what is made of a thrust that is asked for [N] at an airspeed V [m/s]."""
    if aircraft["thrust_rows"] == 0:
        return thrust
    return min(thrust, available_thrust(V, aircraft))


@compiled
def thrust_moment(thrust: float, aircraft: AircraftRecord) -> Vec3:
    """Return the moment of a thrust that is made [N], body axes [N m]."""
    arms = aircraft["thrust_arms"]
    return scale(thrust, (arms[0], arms[1], arms[2]))


@compiled
def reach_of(aircraft: AircraftRecord, j: int, V: float) -> tuple[float, float]:
    """Return the range of an actuator as `range_of`, of the throttle at an airspeed V [m/s]."""
    if j == THROTTLE:
        return 0.0, available_thrust(V, aircraft)
    return range_of(aircraft, j)


def with_any_thrust(aircraft: AircraftRecord) -> AircraftRecord:
    """Return an aircraft that makes any thrust at any airspeed: to find out what a flight takes."""
    free = aircraft.copy()
    free["thrust_rows"] = 0
    return free

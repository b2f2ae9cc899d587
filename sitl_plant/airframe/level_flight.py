"""Steady, level flight of our equations: what to look for is the caller's, one solver finds it.

With an actuator stuck, `stuck_trim` says what is given and what is to be found.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.aerodynamics import control_effectiveness
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import R1, R2, STILL_AIR, state_derivative
from sitl_plant.airframe.thrust import available_thrust, with_any_thrust
from sitl_plant.vec3 import Vec3, mul

NEWTONS = 1000.0
"""Unit of thrust in which it is of the order of one [N]."""
_MAX_ANGLE = math.radians(30.0)  # the coefficients are linear, and say nothing beyond
_TOLERANCE = 1e-10  # relative, of what is found
_LEFT = 1e-6  # m/s², rad/s² and m/s that a steady flight may leave
_AIRSPEEDS = 25  # at which level flight is looked for
_SPEED_ENDS = 0.01  # m/s
_REST = (0.0, 0.0, 0.0)


class Steady(NamedTuple):
    """A motion that is to be steady, and the controls."""

    airspeed: float  # m/s
    alpha: float  # rad
    beta: float  # rad
    roll: float  # rad
    pitch: float  # rad
    delta: Vec3  # aileron, elevator, rudder [rad]
    thrust: float  # N
    turn_rate: float = 0.0  # of the yaw angle [rad/s]


class LevelFlight(NamedTuple):
    """Trim of straight, level flight; angles in degrees.

    Without a rudder, a bank takes its part, which is 0 if the aircraft is symmetric.
    """

    airspeed_m_s: float
    alpha_deg: float
    beta_deg: float
    aileron_deg: float
    elevator_deg: float
    rudder_deg: float
    thrust_n: float
    roll_deg: float = 0.0


def velocity_at(V: float, alpha: float, beta: float) -> Vec3:
    """Return the velocity through the air, body axes [m/s], of an airspeed and angles [rad]."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    return V * ca * cb, V * sb, V * sa * cb


def steady_flight(
    aircraft: AircraftRecord, tried: Callable[[np.ndarray], Steady], begin: list[float]
) -> Steady | None:
    """Return the flight of our equations that is steady and does not climb; None if none is found.

    Args:
        aircraft: The aircraft.
        tried: Motion and controls by the seven numbers that are to be found, all of the order of 1.
        begin: Where the search begins.
    """
    from scipy.optimize import root

    def unrest(x: np.ndarray) -> list[float]:
        one = tried(x)
        v, phi = velocity_at(one.airspeed, one.alpha, one.beta), (one.roll, one.pitch, 0.0)
        state = (_REST, v, phi, mul(R2(phi), (0.0, 0.0, one.turn_rate)))
        _, v_dot, _, omega_dot = state_derivative(
            state, one.thrust, one.delta, _REST, _REST, STILL_AIR, aircraft
        )
        return [*v_dot, *omega_dot, mul(R1(phi), v)[2]]

    found = root(unrest, begin, tol=_TOLERANCE)
    is_steady = found.success and max(map(abs, unrest(found.x))) <= _LEFT
    return tried(found.x) if is_steady else None


def level_flight(aircraft: Aircraft, airspeed_m_s: float) -> LevelFlight | None:
    """Return straight, level flight at an airspeed, within stops or not; None if there is none.

    The thrust is what the flight takes, whether the propulsion can make it or not.
    """
    has_rudder = aircraft.has("rudder")

    def tried(x: np.ndarray) -> Steady:
        alpha, beta, pitch, aileron, elevator, last, thrust = x.tolist()
        rudder, roll = (last, 0.0) if has_rudder else (0.0, last)
        delta = aileron, elevator, rudder
        return Steady(airspeed_m_s, alpha, beta, roll, pitch, delta, NEWTONS * thrust)

    record = with_any_thrust(aircraft_record(aircraft))
    found = steady_flight(record, tried, [0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.1])
    if found is None or max(abs(found.alpha), abs(found.beta)) > _MAX_ANGLE:
        return None
    aileron, elevator, rudder = map(math.degrees, found.delta)
    return LevelFlight(
        airspeed_m_s=airspeed_m_s,
        alpha_deg=math.degrees(found.alpha),
        beta_deg=math.degrees(found.beta),
        aileron_deg=aileron,
        elevator_deg=elevator,
        rudder_deg=rudder,
        thrust_n=found.thrust,
        roll_deg=math.degrees(found.roll),
    )


def largest_thrust(aircraft: Aircraft, airspeed_m_s: float) -> float:
    """Return the largest thrust at an airspeed [N]."""
    return float(available_thrust(airspeed_m_s, aircraft_record(aircraft)))


def fastest_level_flight(aircraft: Aircraft) -> float | None:
    """Return the highest airspeed within its limits at which its thrust holds level flight [m/s].

    It is searched from the fastest one down; None if there is no such flight.
    """
    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s

    def is_held(V: float) -> bool:
        flight = level_flight(aircraft, V)
        return flight is not None and flight.thrust_n <= largest_thrust(aircraft, V)

    tried = np.linspace(high, low, _AIRSPEEDS).tolist()
    first = next((k for k, V in enumerate(tried) if is_held(V)), None)
    if first is None or first == 0:
        return None if first is None else high
    slow, fast = tried[first], tried[first - 1]
    while fast - slow > _SPEED_ENDS:
        middle = (slow + fast) / 2.0
        slow, fast = (middle, fast) if is_held(middle) else (slow, middle)
    return float(slow)


def authority(aircraft: Aircraft, airspeed_m_s: float) -> dict[str, float]:
    """Return the angular acceleration by full deflection of each surface [rad/s²].

    It is that to the side of the nearer stop.
    """
    effect = control_effectiveness(aircraft_record(aircraft)) * airspeed_m_s**2
    stops = np.radians(aircraft.stops_deg)
    return {
        name: abs(float(effect[i, i])) * float(np.abs(stops[i]).min())
        for i, name in enumerate(SURFACES)
        if aircraft.has(name)
    }

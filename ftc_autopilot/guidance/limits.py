"""What can be flown: how tight a turn, how steep a climb."""

import math
from typing import NamedTuple

__all__ = ["FlightLimits", "fastest", "tightest_turn", "turn_radius"]

_PLANNED_BANK = math.radians(20.0)
"""Bank of a turn whose radius is free [rad]."""
_RESERVE = math.radians(5.0)
"""Bank kept for corrections [rad]."""


class FlightLimits(NamedTuple):
    """What guidance may ask of the aircraft.

    Attributes:
        cruise_m_s: Airspeed until a mission says another.
        bank_rad: Greatest bank.
        climb: Steepest climb and descent, height per length.
        wind_m_s: Wind that turns must allow for.
        offset_m: Farthest slot of the formation to the side of the path.
        gravity_m_s2: Acceleration of gravity.
    """

    cruise_m_s: float
    bank_rad: float
    climb: float
    wind_m_s: float
    offset_m: float
    gravity_m_s2: float


def turn_radius(airspeed: float, limits: FlightLimits) -> float:
    """Return the radius of a turn that may have any [m]: that of 20° of bank in still air."""
    easy = airspeed**2 / (limits.gravity_m_s2 * math.tan(_PLANNED_BANK))
    return max(easy, tightest_turn(airspeed, limits))


def tightest_turn(airspeed: float, limits: FlightLimits) -> float:
    """Return the least radius R [m] at an airspeed [m/s].

    With the wind from behind, and for who flies on the outside, (V + w)² (1 + d/R) / R must be
    within g tan(bank), with 5° of bank kept for corrections.
    """
    ground, acceleration = airspeed + limits.wind_m_s, _acceleration(limits)
    return (ground**2 + math.sqrt(ground**4 + 4.0 * acceleration * ground**2 * limits.offset_m)) / (
        2.0 * acceleration
    )


def fastest(radius: float, limits: FlightLimits) -> float:
    """Return the greatest airspeed [m/s] in a turn of a radius [m], as `tightest_turn` has it."""
    share = radius / (1.0 + limits.offset_m / radius)
    return math.sqrt(_acceleration(limits) * share) - limits.wind_m_s


def _acceleration(limits: FlightLimits) -> float:
    return limits.gravity_m_s2 * math.tan(limits.bank_rad - _RESERVE)

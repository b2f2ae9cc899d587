"""What can be flown: how tight a turn, how steep a climb."""

import math
from typing import TYPE_CHECKING, NamedTuple

from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

if TYPE_CHECKING:  # stations need the limits, and no figures
    from ftc_autopilot.guidance.runway import RunwayFigures

_carried_linearly = in_python(aerodynamics.carried_linearly)
_PLANNED_BANK = math.radians(20.0)
"""Bank of a turn whose radius is free [rad]."""
_RESERVE = math.radians(5.0)
"""Bank kept for corrections [rad]."""
_MAX_AIRSPEED = 200
"""Highest airspeed considered [m/s]."""
_MIN_ROOM_M_S = 1.0
"""Change of the airspeed that a turn may take at the end of the range of airspeeds [m/s]."""
_MIN_BANK = math.radians(1.0)
"""Bank that is left for turns when the airspeed is too low for any [rad]."""


class FlightLimits(NamedTuple):
    """What guidance may ask of the aircraft.

    Attributes:
        cruise_m_s: Airspeed until a mission says another.
        bank_rad: Greatest bank.
        level_m_s: Airspeed at which level flight takes the greatest angle of attack.
        climb: Steepest climb and descent, height per length.
        wind_m_s: Wind that turns must allow for.
        offset_m: Farthest slot of the formation to the side of the path.
        gravity_m_s2: Acceleration of gravity.
        slowest_m_s: Lowest airspeed, also on the inside of a turn.
        fastest_m_s: Highest airspeed, also on the outside of a turn.
        lowest_m: Lowest place, above home.
        highest_m: Highest place, above home.
        runway: Take-off and landing; None: neither is planned.
    """

    cruise_m_s: float
    bank_rad: float
    level_m_s: float
    climb: float
    wind_m_s: float
    offset_m: float
    gravity_m_s2: float
    slowest_m_s: float = 0.0
    fastest_m_s: float = math.inf
    lowest_m: float = -math.inf
    highest_m: float = math.inf
    runway: "RunwayFigures | None" = None


def level_airspeed(aircraft: Aircraft, incidence_rad: float) -> float:
    """Return the airspeed at which level flight takes an angle of attack [m/s].

    The thrust, which equals the drag, carries its part of the weight.
    """
    at_zero, slope = _carried_linearly(aircraft_record(aircraft))
    lift = max(at_zero + slope * incidence_rad, 1e-6)
    area = 0.5 * aircraft.air_density_kg_m3 * aircraft.wing_area_m2
    return math.sqrt(aircraft.mass_kg * aircraft.gravity_m_s2 / (area * lift))


def turn_radius(airspeed: float, limits: FlightLimits) -> float:
    """Return the radius of a turn that may have any [m]: of 20° of bank in still air."""
    easy = airspeed**2 / (limits.gravity_m_s2 * math.tan(_PLANNED_BANK))
    return max(easy, tightest_turn(airspeed, limits))


def tightest_turn(airspeed: float, limits: FlightLimits) -> float:
    """Return the least radius R [m] at an airspeed [m/s].

    With the wind from behind, and on the outside of the turn, (V + w)² (1 + d/R) / R must be
    within g tan(bank), with 5° of bank kept for corrections. The bank is also limited by the angle
    of attack that it takes: at V it may be acos((V_level/V)²). A UAV on the inside is slower by
    (V + w) d/R, and one on the outside faster; both must have that airspeed.
    """
    ground, acceleration = airspeed + limits.wind_m_s, _acceleration(airspeed, limits)
    by_bank = ground**2 + math.sqrt(ground**4 + 4.0 * acceleration * ground**2 * limits.offset_m)
    room = min(airspeed - limits.slowest_m_s, limits.fastest_m_s - airspeed)
    by_speed = ground * limits.offset_m / max(room, _MIN_ROOM_M_S)
    return max(by_bank / (2.0 * acceleration), by_speed)


def too_tight(radius: float, airspeed: float, limits: FlightLimits) -> str | None:
    """Return what is wrong with the radius of a circle [m]; None if it can be flown, or may be any.

    Args:
        radius: Positive or not; 0: any.
        airspeed: Around it [m/s].
        limits: What the aircraft can fly.
    """
    least = tightest_turn(airspeed, limits)
    if radius == 0.0 or abs(radius) >= least:
        return None
    text = f"radius {abs(radius):g} m, must be >= {math.ceil(least)} m at {airspeed:g} m/s"
    airspeeds = airspeeds_for(abs(radius), limits)
    return (
        text if airspeeds is None else text + " (or the airspeed {} to {} m/s)".format(*airspeeds)
    )


def airspeeds_for(radius: float, limits: FlightLimits) -> tuple[int, int] | None:
    """Return the least and greatest whole airspeed within limits in a turn of a radius, if any.

    A slow aircraft needs its angle of attack to fly level, and has none left to turn.
    """
    slowest = math.ceil(max(limits.level_m_s, limits.slowest_m_s))
    able = range(slowest, math.floor(min(limits.fastest_m_s, _MAX_AIRSPEED)) + 1)
    speeds = [v for v in able if tightest_turn(float(v), limits) <= radius]
    return (speeds[0], speeds[-1]) if speeds else None


def _acceleration(airspeed: float, limits: FlightLimits) -> float:
    """Return the centripetal acceleration that turns may take [m/s²]."""
    load = max((airspeed / limits.level_m_s) ** 2, 1.0)
    bank = min(limits.bank_rad, math.acos(1.0 / load)) - _RESERVE
    return limits.gravity_m_s2 * math.tan(max(bank, _MIN_BANK))

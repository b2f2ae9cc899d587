"""Limits of guidance that are the aircraft's own, wherever no scenario says another.

Guidance was found with the paper's aircraft at 45 m/s. Others have their limits by the ratio of
airspeeds, by their stall and by their thrust. `gcs design` writes the same, from a trim in place of
the estimate here.
"""

import functools
import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from ftc_autopilot.guidance.laws.base import GuidanceParameters
from mavlink_defs.config.models import Loc
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics, thrust
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

_HOME_M_S = 45.0
"""Airspeed at which the paper's aircraft has the limits `HOME`."""
_BELOW_STALL_DEG = 3.0
_THRUST_SHARE = 0.9
"""Share of the thrust that the steepest climb takes."""
_ANY_WEIGHT_N = 1e-6
_MIN_ACCELERATION_M_S2 = 0.1
_MAX_ALPHA = math.radians(30.0)
_AIRSPEEDS = 101
"""At which level flight is tried, to find the fastest that the thrust holds."""

# a ground station that checks a scenario does not wait for numba
_available_thrust = in_python(thrust.available_thrust)
_carried_linearly = in_python(aerodynamics.carried_linearly)
_drag = in_python(aerodynamics.drag)

Guidance = TypeVar("Guidance", bound=GuidanceParameters)


class AircraftLimits(NamedTuple):
    """Limits of guidance, named and in units as in `GuidanceParameters`."""

    cruise_m_s: float
    airspeed_min_m_s: float
    airspeed_max_m_s: float
    incidence_max_deg: float
    climb_max_deg: float
    acceleration_max_m_s2: float


HOME = AircraftLimits(40.0, 30.0, 60.0, 15.0, 20.0, 20.0)
"""Of the paper's aircraft, whose cruise is the (geometric) middle of its airspeeds, 20 to 80."""


def for_aircraft(guidance: Guidance, aircraft: Aircraft) -> Guidance:
    """Return guidance with every limit that it leaves open as of an aircraft."""
    return guidance.model_copy(update=limits_of(guidance, aircraft)._asdict())


def limits_of(guidance: GuidanceParameters, aircraft: Aircraft) -> AircraftLimits:
    """Return the limits that guidance has with an aircraft: those given, else the aircraft's own.

    Airspeeds are within those that the aircraft accepts. The aircraft's own give way to those
    given, so that only what is given can be wrong, see `guidance_problems`.
    """
    own = _own_limits(aircraft)
    given = {name: one for name in own._fields if (one := getattr(guidance, name)) is not None}
    low, high = own.airspeed_min_m_s, own.airspeed_max_m_s
    if "airspeed_min_m_s" in given:
        low = max(given["airspeed_min_m_s"], aircraft.airspeed_min_m_s)
    if "airspeed_max_m_s" in given:
        high = min(given["airspeed_max_m_s"], aircraft.airspeed_max_m_s)
    if low > high:
        low = low if "airspeed_min_m_s" in given else aircraft.airspeed_min_m_s
        high = high if "airspeed_max_m_s" in given else aircraft.airspeed_max_m_s
    merged = own._replace(**given)
    cruise = min(max(merged.cruise_m_s, low), high)
    return merged._replace(cruise_m_s=cruise, airspeed_min_m_s=low, airspeed_max_m_s=high)


@functools.lru_cache
def _own_limits(aircraft: Aircraft) -> AircraftLimits:
    """Return the limits of an aircraft, which every check of a scenario asks for."""
    airspeed = _airspeed_of(aircraft)
    return limits_at(aircraft, airspeed, _level_thrust(aircraft, airspeed), _fastest(aircraft))


def guidance_problems(
    guidance: GuidanceParameters, aircraft: Aircraft
) -> Iterator[tuple[Loc, str]]:
    """Yield place and text of each airspeed of guidance that an aircraft cannot have."""
    lowest, highest = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s
    low, high, cruise = guidance.airspeed_min_m_s, guidance.airspeed_max_m_s, guidance.cruise_m_s
    if low is not None and low > highest:
        text = f"expected <= {highest:g} m/s, the aircraft's airspeed_max_m_s"
        yield ("guidance", "airspeed_min_m_s"), f"{text}, got {low!r}"
    if high is not None and high < lowest:
        text = f"expected >= {lowest:g} m/s, the aircraft's airspeed_min_m_s"
        yield ("guidance", "airspeed_max_m_s"), f"{text}, got {high!r}"
    limits = limits_of(guidance, aircraft)
    if cruise is not None and cruise != limits.cruise_m_s:
        able = f"[{limits.airspeed_min_m_s:g}, {limits.airspeed_max_m_s:g}] m/s"
        text = f"expected {able}, the limits of guidance and aircraft"
        yield ("guidance", "cruise_m_s"), f"{text}, got {cruise!r}"


def limits_at(
    aircraft: Aircraft, airspeed_m_s: float, level_n: float, fastest_m_s: float
) -> AircraftLimits:
    """Return an aircraft's own limits.

    Args:
        aircraft: The aircraft.
        airspeed_m_s: Its cruising speed.
        level_n: Thrust of level flight there [N].
        fastest_m_s: Highest airspeed for which it has the thrust.
    """
    low, high = aircraft.airspeed_min_m_s, min(aircraft.airspeed_max_m_s, fastest_m_s)
    ratio, weight = airspeed_m_s / _HOME_M_S, aircraft.mass_kg * aircraft.gravity_m_s2
    cruise, slowest, fastest = (min(max(few_digits(home * ratio), low), high) for home in HOME[:3])
    stall = aircraft.stall_deg
    below_stall = math.inf if stall is None else round(stall - _BELOW_STALL_DEG, 1)
    largest = float(_available_thrust(airspeed_m_s, aircraft_record(aircraft)))
    climb = (_THRUST_SHARE * largest - level_n) / max(weight, _ANY_WEIGHT_N)
    spare = float(f"{(largest - level_n) / aircraft.mass_kg:.3g}")
    return AircraftLimits(
        cruise,
        slowest,
        fastest,
        min(HOME.incidence_max_deg, below_stall),
        min(HOME.climb_max_deg, round(math.degrees(math.asin(min(max(climb, 0.02), 1.0))), 1)),
        min(HOME.acceleration_max_m_s2, max(spare, _MIN_ACCELERATION_M_S2)),
    )


def few_digits(value: float) -> float:
    """Return a number of four significant digits."""
    return float(f"{value:.4g}")


def _airspeed_of(aircraft: Aircraft) -> float:
    """Return what 45 m/s are to the paper's aircraft [m/s]: the cruise, or by the range alone."""
    if aircraft.cruise_m_s is not None:
        return aircraft.cruise_m_s
    amid = math.sqrt(aircraft.airspeed_min_m_s * aircraft.airspeed_max_m_s)
    return _HOME_M_S * (amid / HOME.cruise_m_s)


def _level_thrust(aircraft: Aircraft, airspeed_m_s: float) -> float:
    """Return about what level flight takes [N], the moments not balanced."""
    record = aircraft_record(aircraft)
    area = 0.5 * aircraft.air_density_kg_m3 * airspeed_m_s**2 * aircraft.wing_area_m2
    at_zero, slope = _carried_linearly(record)
    alpha = (aircraft.mass_kg * aircraft.gravity_m_s2 / area - at_zero) / max(slope, 1e-6)
    alpha = min(max(alpha, -_MAX_ALPHA), _MAX_ALPHA)
    return float(_drag(area, alpha, record)) / math.cos(alpha)


def _fastest(aircraft: Aircraft) -> float:
    """Return the highest airspeed that its propulsion holds, if its file says that [m/s]."""
    record, high = aircraft_record(aircraft), aircraft.airspeed_max_m_s
    if aircraft.propulsion is None:
        return high
    tried = np.linspace(high, aircraft.airspeed_min_m_s, _AIRSPEEDS).tolist()
    held = (V for V in tried if _level_thrust(aircraft, V) <= _available_thrust(V, record))
    return few_digits(next(held, _airspeed_of(aircraft)))

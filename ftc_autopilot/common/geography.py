"""Position on Earth of the simulation's flat world.

North, east and down [m] count from an origin, whose geographic coordinates say where telemetry,
missions and targets lie. The Earth is a sphere there, as in ArduPilot: 1 cm off after 3 km.
"""

import math
from typing import NamedTuple

from mavlink_defs.origin import EARTH_RADIUS_M, Origin, degrees_at

__all__ = ["Origin", "Place", "place_of", "position_of"]


class Place(NamedTuple):
    """A place in the units of MAVLink."""

    latitude: int  # degE7
    longitude: int  # degE7
    altitude: int  # mm above mean sea level
    height: int  # mm above the origin


def place_of(origin: Origin, north: float, east: float, down: float) -> Place:
    """Return the geographic place of a position [m, NED], clipped to what messages can hold."""
    latitude, longitude = degrees_at(
        _sane(north), _sane(east), origin.latitude_deg, origin.longitude_deg
    )
    height = -_sane(down)
    return Place(
        round(min(max(latitude, -90.0), 90.0) * 1e7),
        round(longitude * 1e7),
        round((origin.altitude_m + height) * 1e3),
        round(height * 1e3),
    )


def position_of(origin: Origin, latitude: int, longitude: int) -> tuple[float, float]:
    """Return north and east [m] of a place [degE7]; the inverse of `place_of`, short way round."""
    north = math.radians(latitude / 1e7 - origin.latitude_deg) * EARTH_RADIUS_M
    parallel_m = EARTH_RADIUS_M * math.cos(math.radians(origin.latitude_deg))
    degrees = (longitude / 1e7 - origin.longitude_deg + 180.0) % 360.0 - 180.0
    return north, math.radians(degrees) * parallel_m


def _sane(metres: float) -> float:
    """Return a coordinate clipped to ±1000 km, which fits every message; 0 for NaN."""
    return min(max(metres, -1e6), 1e6) if metres == metres else 0.0  # noqa: PLR0124 - NaN

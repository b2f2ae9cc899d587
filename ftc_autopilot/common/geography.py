"""Position on Earth of the simulation's flat world.

North, east and down [m] count from an origin; its geographic coordinates are used by telemetry
only. The Earth is a sphere there, as in ArduPilot: 1 cm off after 3 km.
"""

import math
from typing import NamedTuple

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity

_EARTH_RADIUS_M = 6378137.0


class Origin(Model):
    """Geographic coordinates of north = east = down = 0, which is also home.

    The default is where ArduPilot's simulation begins: CMAC, a model airfield near Canberra.
    """

    latitude_deg: float = quantity(
        "deg", ge=-89.0, le=89.0, default=-35.363262, doc="Latitude, WGS 84."
    )
    longitude_deg: float = quantity(
        "deg", ge=-180.0, le=180.0, default=149.165237, doc="Longitude, WGS 84."
    )
    altitude_m: float = quantity(
        "m", ge=-500.0, le=9000.0, default=584.0, doc="Altitude above mean sea level."
    )


class Place(NamedTuple):
    """A place in the units of MAVLink."""

    latitude: int  # degE7
    longitude: int  # degE7
    altitude: int  # mm above mean sea level
    height: int  # mm above the origin


def place_of(origin: Origin, north: float, east: float, down: float) -> Place:
    """Return the geographic place of a position [m, NED], clipped to what messages can hold."""
    latitude = origin.latitude_deg + math.degrees(_sane(north) / _EARTH_RADIUS_M)
    parallel_m = _EARTH_RADIUS_M * math.cos(math.radians(origin.latitude_deg))
    longitude = origin.longitude_deg + math.degrees(_sane(east) / parallel_m)
    longitude = (longitude + 180.0) % 360.0 - 180.0
    height = -_sane(down)
    return Place(
        round(min(max(latitude, -90.0), 90.0) * 1e7),
        round(longitude * 1e7),
        round((origin.altitude_m + height) * 1e3),
        round(height * 1e3),
    )


def position_of(origin: Origin, latitude: int, longitude: int) -> tuple[float, float]:
    """Return north and east [m] of a place [degE7]; the inverse of `place_of`, short way round."""
    north = math.radians(latitude / 1e7 - origin.latitude_deg) * _EARTH_RADIUS_M
    parallel_m = _EARTH_RADIUS_M * math.cos(math.radians(origin.latitude_deg))
    degrees = (longitude / 1e7 - origin.longitude_deg + 180.0) % 360.0 - 180.0
    return north, math.radians(degrees) * parallel_m


def _sane(metres: float) -> float:
    """Return a coordinate clipped to ±1000 km, which fits every message; 0 for NaN."""
    return min(max(metres, -1e6), 1e6) if metres == metres else 0.0  # noqa: PLR0124 - NaN

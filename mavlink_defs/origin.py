"""Where on Earth the simulation's flat world lies."""

import math

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity

EARTH_RADIUS_M = 6378137.0
"""Radius of the sphere on which north and east [m] become latitude and longitude."""


class Origin(Model):
    """Geographic coordinates of north = east = down = 0, which is also home.

    The default is where ArduPilot's simulation begins: CMAC, a model airfield near Canberra.

    Attributes:
        latitude_deg: Latitude, WGS 84.
        longitude_deg: Longitude, WGS 84.
        altitude_m: Altitude above mean sea level.
    """

    latitude_deg: float = quantity("deg", default=-35.363262, ge=-89.0, le=89.0)
    longitude_deg: float = quantity("deg", default=149.165237, ge=-180.0, le=180.0)
    altitude_m: float = quantity("m", default=584.0, ge=-500.0, le=9000.0)


def degrees_at(north: float, east: float, latitude: float, longitude: float) -> tuple[float, float]:
    """Return latitude and longitude [deg] of a position [m] from an origin [deg]."""
    parallel_m = EARTH_RADIUS_M * math.cos(math.radians(latitude))
    turned = longitude + math.degrees(east / parallel_m)
    return latitude + math.degrees(north / EARTH_RADIUS_M), (turned + 180.0) % 360.0 - 180.0

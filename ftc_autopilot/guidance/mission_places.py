"""Places as MAVLink gives them, in the simulation's world: checked once, for items and commands."""

import math
from dataclasses import dataclass

from ftc_autopilot.common.geography import Origin, place_of, position_of
from ftc_autopilot.guidance.limits import FlightLimits
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

ANYWHERE_M = 100_000.0
"""Farthest place from the origin; the simulation's world is flat [m]."""
RELATIVE_FRAMES = {
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
}
"""MAV_FRAMEs whose altitudes count from home; the ground is flat, as far as a vehicle knows."""
_ABSOLUTE_FRAMES = {dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT}
"""MAV_FRAMEs whose altitudes are above mean sea level."""
_ROUNDING_M = 1e-3
"""What a height may lose on its way through a message [m]."""


@dataclass(frozen=True)
class Home:
    """Where RETURN_TO_LAUNCH leads, and what relative altitudes count from.

    Attributes:
        north_m: [m].
        east_m: [m].
        height_m: Above the origin [m].
    """

    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = 0.0


def north_east_of(x: int, y: int, origin: Origin, item: int = 0) -> tuple[float, float]:
    """Return north and east [m] of a latitude and a longitude [degE7].

    Args:
        x: Latitude.
        y: Longitude.
        origin: Of the simulation's world.
        item: Number of the mission item, for the error.

    Raises:
        ItemError: There is no such place, or it is too far away.
    """
    if INT32_MAX in (abs(x), abs(y)):
        text = "latitude or longitude is not given"
        raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM5_X, text)
    for value, limit, name, number in ((x, 90.0, "latitude", 5), (y, 180.0, "longitude", 6)):
        if abs(value) > limit * 1e7:
            text = f"{name} {value / 1e7:g}, must be -{limit:g} to {limit:g} deg"
            raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM1 + number - 1, text)
    north, east = position_of(origin, x, y)
    away = math.hypot(north, east)
    if away > ANYWHERE_M:
        here = f"{{latitude_deg: {x / 1e7:.4f}, longitude_deg: {y / 1e7:.4f}}}"
        text = f"{away / 1e3:.0f} km from the origin, must be <= {ANYWHERE_M / 1e3:g} km; to fly"
        text += f" there, give the scenario origin: {here}; to fly it here, gcs mission has --here"
        raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM5_X, text)
    return north, east


def height_of(frame: int, altitude: float, origin: Origin, home: Home, item: int = 0) -> float:
    """Return the height above the origin [m] of an altitude.

    Args:
        frame: MAV_FRAME, which says what the altitude counts from.
        altitude: [m].
        origin: Of the simulation's world.
        home: What relative altitudes count from.
        item: Number of the mission item, for the error.

    Raises:
        ItemError: There is no such height, or it is too far away.
    """
    if frame not in RELATIVE_FRAMES | _ABSOLUTE_FRAMES:
        text = f"frame {frame} is not supported, must be global, absolute or relative"
        raise ItemError(item, dialect.MAV_MISSION_UNSUPPORTED_FRAME, text)
    if math.isnan(altitude):
        raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM7, "altitude is not given")
    zero = home.height_m if frame in RELATIVE_FRAMES else -origin.altitude_m
    height = altitude + zero
    if not abs(height) <= ANYWHERE_M:
        text = f"altitude {altitude:g} m, must be within {ANYWHERE_M / 1e3:g} km of the origin's"
        raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM7, text)
    return height


def check_height(height: float, home: Home, limits: FlightLimits, item: int = 0) -> None:
    """Refuse a place that lies too low or too high above home.

    Args:
        height: Above the origin [m].
        home: Home.
        limits: What guidance may ask of the aircraft.
        item: Number of the mission item, for the error.

    Raises:
        ItemError: It does.
    """
    above, low, high = height - home.height_m, limits.lowest_m, limits.highest_m
    if not low - _ROUNDING_M <= above <= high + _ROUNDING_M:
        text = f"altitude is {above:.7g} m above home, must be {low:g} to {high:g} m"
        raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM7, text)


def home_item(origin: Origin, home: Home = Home()) -> MissionItem:
    """Return item 0 of every mission, the home position."""
    place = place_of(origin, home.north_m, home.east_m, -home.height_m)
    return mission_item(
        0,
        dialect.MAV_CMD_NAV_WAYPOINT,
        (),
        place.latitude,
        place.longitude,
        place.altitude / 1e3,
        dialect.MAV_FRAME_GLOBAL,
    )

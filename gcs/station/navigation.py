"""Where vehicles are and where they are to be, from their telemetry.

Places are north and east in the vehicles' common local frame [m]. A function returns None while
the vehicle has not reported it.
"""

import math
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from ftc_autopilot.common.geography import Origin, place_of, position_of
from ftc_autopilot.guidance.mission_items import has_place
from ftc_autopilot.guidance.mission_places import RELATIVE_FRAMES
from gcs.station.mission import HAS_PLACE
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

_DEG_E7 = 1e7
_LOCAL_POSITION = dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED


@dataclass(frozen=True)
class KnownHome:
    """A vehicle's home.

    Attributes:
        origin: Its geographic coordinates.
        north_m: Its place.
        east_m: The same.
    """

    origin: Origin
    north_m: float
    east_m: float

    def place_of(self, item: MissionItem) -> tuple[float, float] | None:
        """Return north and east of an item [m]; None if it leads to no place of its own."""
        if item.command not in HAS_PLACE or not has_place(item):
            return None
        north, east = position_of(self.origin, item.x, item.y)
        return self.north_m + north, self.east_m + east

    def degrees_of(self, north_m: float, east_m: float) -> tuple[int, int]:
        """Return latitude and longitude of a place [degE7]."""
        place = place_of(self.origin, north_m - self.north_m, east_m - self.east_m, 0.0)
        return place.latitude, place.longitude

    def item(self) -> MissionItem:
        """Return item 0 of a mission that begins here."""
        place = place_of(self.origin, 0.0, 0.0, 0.0)
        degrees = (place.latitude, place.longitude)
        frame, altitude_m = dialect.MAV_FRAME_GLOBAL_INT, self.origin.altitude_m
        no_yaw = (0.0, 0.0, 0.0, math.nan)
        return mission_item(0, dialect.MAV_CMD_NAV_WAYPOINT, no_yaw, *degrees, altitude_m, frame)

    def height_of(self, item: MissionItem) -> float:
        """Return the height of an item above home [m]."""
        return float(item.z) - (0.0 if item.frame in RELATIVE_FRAMES else self.origin.altitude_m)

    def altitude_of(self, item: MissionItem, height_m: float) -> float:
        """Return the altitude that an item has at a height above home [m], in its own frame."""
        return height_m + (0.0 if item.frame in RELATIVE_FRAMES else self.origin.altitude_m)


def home_of(state: VehicleState) -> KnownHome | None:
    """Return a vehicle's home, from HOME_POSITION; None, too, if that is no place on Earth."""
    message = state.latest.get(dialect.MAVLINK_MSG_ID_HOME_POSITION)
    if message is None:
        return None
    try:
        origin = Origin(
            latitude_deg=message.latitude / _DEG_E7,
            longitude_deg=message.longitude / _DEG_E7,
            altitude_m=message.altitude / 1e3,
        )
    except ValidationError:
        return None
    return KnownHome(origin, message.x, message.y)


def wind_of(state: VehicleState) -> tuple[float, float] | None:
    """Return the velocity of the air, north and east [m/s], from WIND_COV."""
    message = state.latest.get(dialect.MAVLINK_MSG_ID_WIND_COV)
    return None if message is None else (message.wind_x, message.wind_y)


def current_item(state: VehicleState) -> int | None:
    """Return the number of the item that a vehicle flies to, from MISSION_CURRENT."""
    message = state.latest.get(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)
    return None if message is None else int(message.seq)


def distance_to_item(state: VehicleState) -> float | None:
    """Return the distance to that item [m], from NAV_CONTROLLER_OUTPUT."""
    message = state.latest.get(dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT)
    return None if message is None else float(message.wp_dist)


def is_on_path(state: VehicleState) -> bool:
    """Return whether a vehicle flies a path, in a formation."""
    return _formation(state) is not None


def slot_error_of(state: VehicleState) -> tuple[float, float, float] | None:
    """Return how far ahead, to the right and above its slot a vehicle takes itself to be [m]."""
    message = _formation(state)
    if message is None or not all(map(math.isfinite, message.slot_error)):
        return None
    ahead, right, up = message.slot_error
    return ahead, right, up


def slot_place_of(state: VehicleState) -> tuple[float, float] | None:
    """Return north and east of a vehicle's slot, as it sees it [m]."""
    error, motion = slot_error_of(state), state.latest.get(_LOCAL_POSITION)
    if error is None or motion is None:
        return None
    speed = math.hypot(motion.vx, motion.vy)
    if speed == 0.0:
        return None
    cos_c, sin_c = motion.vx / speed, motion.vy / speed  # its course is nearly the path's
    ahead, right, _ = error
    return motion.x - cos_c * ahead + sin_c * right, motion.y - sin_c * ahead - cos_c * right


def nearest_of(state: VehicleState) -> float | None:
    """Return the distance to the nearest neighbour, as a vehicle sees it [m]."""
    message = _formation(state)
    if message is None or not math.isfinite(message.distance):
        return None
    return float(message.distance)


def _formation(state: VehicleState) -> Any:
    """Return FTC_FORMATION while a path is flown."""
    message = state.latest.get(dialect.MAVLINK_MSG_ID_FTC_FORMATION)
    return None if message is None or message.path_id == 0 else message

"""Home of a vehicle: where it returns to, and what relative altitudes count from."""

from ftc_autopilot.common.geography import Origin, Place, place_of
from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem


class VehicleHome:
    """The home in force; at first the origin.

    Attributes:
        at: Home, relative to the origin.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self.at = Home()

    @property
    def place(self) -> Place:
        """Home in the units of MAVLink; its height is that above the origin."""
        return place_of(self._origin, self.at.north_m, self.at.east_m, -self.at.height_m)

    def move_to(self, north: float, east: float, height: float) -> None:
        """Set it to a place relative to the origin [m]."""
        self.at = Home(north, east, height)

    def item(self) -> MissionItem:
        """Return item 0 of every mission."""
        return home_item(self._origin, self.at)


def home_item(origin: Origin, home: Home = Home()) -> MissionItem:  # noqa: B008 - frozen
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

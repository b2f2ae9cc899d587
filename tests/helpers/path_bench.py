"""A vehicle on paths, whose aircraft is where it is put."""

import math
from typing import Any

from vehicle_bench import ACCEPTED, ARM, Bench, of_type

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.path import point_at
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
SET_MODE = dialect.MAV_CMD_DO_SET_MODE
WAYPOINT, SPEED = dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_CMD_DO_CHANGE_SPEED
HOME = mission_item(0, WAYPOINT)
PLACE = (-353500000, 1491652370)


def waypoint(seq: int, north: float, east: float, height: float = 100.0) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)[:2]
    return mission_item(seq, WAYPOINT, (), *place, height)


TRIANGLE = (waypoint(1, 3000.0, 0.0), waypoint(2, 3000.0, 3000.0), waypoint(3, 0.0, 3000.0))


class PathBench(Bench):
    """A bench whose aircraft is where it is put."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.path = self.vehicle.modes.path
        self.guidance = self.controllers.uavs[0]["guidance"]
        self.put(0.0, 0.0)

    def put(self, north: float, east: float, height: float = 100.0) -> None:
        self.hot.measured["position"] = (north, east, -height)

    def fly(self) -> None:
        """Arm, and let simulated time run."""
        assert self.command(ARM, 1.0) == ACCEPTED
        self.run()

    def go_to(self, s: float) -> list[Any]:
        """Put the aircraft on its path; return what the vehicle tells."""
        self.guidance["path_position"] = s
        point = point_at(self.path.record, s)
        self.put(point.north, point.east, point.height)
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return self.vehicle.gcs_messages()

    def mission_state(self) -> int:
        current: Any = self.vehicle._plan.mission.current()
        return int(current.mission_state)

    def texts(self, messages: list[Any]) -> str:
        return "".join(message.text for message in of_type(messages, "STATUSTEXT"))

    def circle(self) -> tuple[float, float, float]:
        """Centre and radius, positive clockwise, of the circle that the path ends in."""
        path = self.path.record
        last = int(path["count"]) - 1
        radius = 1.0 / float(path["curvature"][last])
        course = float(path["course"][last])
        north = float(path["north"][last]) - radius * math.sin(course)
        return north, float(path["east"][last]) + radius * math.cos(course), radius

"""A vehicle with a fence and rally points, which flies and is where it is put."""

import math
from collections.abc import Sequence
from typing import Any

from vehicle_bench import ACCEPTED, ARM, UAV, Bench, of_type

from ftc_autopilot.common.geography import Origin, place_of
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
FENCE, RALLY = dialect.MAV_MISSION_TYPE_FENCE, dialect.MAV_MISSION_TYPE_RALLY
ENABLE, SET_MODE = dialect.MAV_CMD_DO_FENCE_ENABLE, dialect.MAV_CMD_DO_SET_MODE
SET_HOME = dialect.MAV_CMD_DO_SET_HOME
CIRCLE = dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
NO_GO = dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
RETURN_POINT, RALLY_POINT = (
    dialect.MAV_CMD_NAV_FENCE_RETURN_POINT,
    dialect.MAV_CMD_NAV_RALLY_POINT,
)
FAILED = dialect.MAV_RESULT_FAILED
GEOFENCE = dialect.MAV_SYS_STATUS_GEOFENCE


def item(
    seq: int, command: int, north: float, east: float, param: float = 0.0, height: float = 0.0
) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)[:2]
    return mission_item(seq, command, (param,), *place, height)


AROUND = (item(0, CIRCLE, 0.0, 0.0, 1000.0),)


class FenceBench(Bench):
    """A vehicle that flies, and is where it is put."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.plan, self.modes = self.vehicle._plan, self.vehicle.modes
        self.position(0.0, 0.0)

    def position(self, north: float, east: float, height: float = 100.0) -> None:
        self.hot.measured["position"] = (north, east, -height)

    def put(self, north: float, east: float = 0.0, height: float = 100.0) -> str:
        """Put the aircraft somewhere, and let a check pass; return what the vehicle says."""
        self.position(north, east, height)
        self.hot.step = (max(self.hot.step, 0) // 1000 + 1) * 1000
        self.hot.measured["time_usec"] = self.hot.step * 1000
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return texts(self.vehicle.gcs_messages())

    def upload_type(self, mission_type: int, items: Sequence[MissionItem]) -> tuple[int, str]:
        """Upload a list of a type; return MAV_MISSION_RESULT, and what the vehicle says."""
        answers = self.say(dialect.MAVLink_mission_count_message(UAV, 1, len(items), mission_type))
        while requests := of_type(answers, "MISSION_REQUEST_INT"):
            one = items[requests[0].seq]
            one.target_system, one.target_component, one.mission_type = UAV, 1, mission_type
            answers = self.say(one)
        (ack,) = of_type(answers, "MISSION_ACK")
        assert ack.mission_type == mission_type
        return ack.type, texts(answers)

    def set(self, **params: float) -> str:
        said = ""
        for name, value in params.items():
            said += texts(
                self.say(dialect.MAVLink_param_set_message(UAV, 1, name.encode(), value, 9))
            )
        return said

    def fly(self) -> None:
        assert self.command(ARM, 1.0) == ACCEPTED
        self.run()

    def fly_fenced(self) -> None:
        """Fly in LOITER, in a circle of 1000 m around home."""
        result, said = self.upload_type(FENCE, AROUND)
        assert (result, said) == (ACCEPTED, "fence of 1 circle held, FENCE_ENABLE is 0\n")
        assert self.command(ENABLE, 1.0) == ACCEPTED
        self.fly()
        assert self.put(0.0) == ""

    def made(self, message: type[Any]) -> Any:
        return self.vehicle.telemetry[0].make(message.id)

    @property
    def status(self) -> tuple[int, int, int]:
        """What FENCE_STATUS says: whether there is a breach, how many there were, of which type."""
        status = self.made(dialect.MAVLink_fence_status_message)
        return status.breach_status, status.breach_count, status.breach_type

    def goal(self) -> tuple[float, float, float]:
        """Centre and height of the circle that the path ends in."""
        path = self.modes.path.record
        last = int(path["count"]) - 1
        north, east, course, curvature, height = (
            float(path[name][last]) for name in ("north", "east", "course", "curvature", "height")
        )
        side = course + math.pi / 2.0
        place = north + math.cos(side) / curvature, east + math.sin(side) / curvature
        return round(place[0]), round(place[1]), round(height)


def texts(messages: list[Any]) -> str:
    joined = ""
    for message in of_type(messages, "STATUSTEXT"):
        joined += message.text + ("" if len(message.text) == 50 else "\n")
    return joined

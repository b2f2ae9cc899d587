"""A vehicle with all its services, and a ground station, message by message."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.restart import with_checkpoint
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.vehicle import VehicleServices
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.profile import segments_to_items
from mavlink_defs.services.mission import MissionItem

GCS = FramePacker(255, 190)
UAV = 1
ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
START = dialect.MAV_CMD_MISSION_START
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


class Bench:
    """A vehicle whose aircraft flies at 40 m/s to the North, and a ground station."""

    def __init__(
        self,
        scenario: Scenario,
        heard: bool = True,
        stations: int = 1,
        checkpoint: Path | None = None,
    ) -> None:
        config = scenario.autopilot_config(UAV)
        config = config.model_copy(update={"gcs": config.gcs * stations})
        self.autopilots, self.resumes = new_autopilots([config]), False
        if checkpoint is not None:
            self.autopilots, self.resumes = with_checkpoint(self.autopilots, config, checkpoint)
        self.controllers = self.autopilots.controllers
        self.hot = HotState(self.autopilots)
        self.hot.measured["velocity"] = (40.0, 0.0, 0.0)
        self.hot.heard_s = float(heard)
        self.vehicle = VehicleServices(config, self.hot, self.controllers)
        self.now = 0.0

    def run(self, flags: int = dialect.FTC_SIM_FLAGS_RUNNING) -> None:
        self.hot.flags = flags

    def say(self, message: Any, station: int = 0) -> list[Any]:
        """Send a message as a ground station; return the vehicle's answers."""
        self.now += 0.01
        received = parse(GCS.pack(message))
        assert received is not None
        self.vehicle.receive(received, self.now, station)
        return self.vehicle.gcs_messages(station)

    def command(self, number: int, *params: float, station: int = 0) -> int:
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(UAV, 1, number, 0, *seven)
        answers = self.say(message, station)
        (ack,) = of_type(answers, "COMMAND_ACK")
        assert ack.command == number
        return int(ack.result)

    def upload(self, scenario: Scenario) -> int:
        return self.upload_items(segments_to_items(scenario.segments(), UAV, 1))

    def upload_items(self, items: Sequence[MissionItem]) -> int:
        for item in items:
            item.target_system, item.target_component = UAV, 1
        answers = self.say(dialect.MAVLink_mission_count_message(UAV, 1, len(items), 0))
        while requests := of_type(answers, "MISSION_REQUEST_INT"):
            answers = self.say(items[requests[0].seq])
        (ack,) = of_type(answers, "MISSION_ACK")
        return int(ack.type)


def of_type(messages: Iterable[Any], name: str) -> list[Any]:
    return [message for message in messages if message.get_type() == name]

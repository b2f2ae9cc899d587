"""Vehicles with all their services that fly, many in one process, without sockets."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from vehicle_bench import GCS, of_type

from ftc_autopilot.control.controllers import NOT_STARTED, Controllers
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.vehicle import VehicleServices
from gcs.fleet.in_process import begin, fly_on, room_of
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import parse
from mavlink_defs.services.mission import MissionItem

ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
START = dialect.MAV_CMD_MISSION_START
SET_MODE = dialect.MAV_CMD_DO_SET_MODE


class Member:
    """One vehicle of a fleet that flies."""

    def __init__(self, scenario: Scenario, uav: int, controllers: Controllers) -> None:
        config = scenario.autopilot_config(uav)
        self.uav, self.controllers = uav, controllers
        self.hot = HotState(new_autopilots([config]))
        self.hot.heard_s, self._now = 1.0, 0.0
        self.vehicle = VehicleServices(config, self.hot, controllers)

    def see(self, state: np.void, step: int) -> None:
        """Take in the state that the vehicle is in after so many steps; its timers run."""
        for name in self.hot.measured.dtype.names or ():
            self.hot.measured[name] = state[name]
        if step > 0:
            self.hot.step, self.hot.flags = step - 1, dialect.FTC_SIM_FLAGS_RUNNING
        self._now += 1.0
        self.vehicle.handle_timer(self._now)
        self.vehicle.gcs_messages()

    def say(self, message: Any) -> list[Any]:
        received = parse(GCS.pack(message))
        assert received is not None
        self.vehicle.receive(received, self._now)
        return self.vehicle.gcs_messages()

    def command(self, number: int, *params: float) -> int:
        seven = (*params, *[0.0] * 7)[:7]
        answers = self.say(dialect.MAVLink_command_long_message(self.uav, 1, number, 0, *seven))
        return int(of_type(answers, "COMMAND_ACK")[0].result)

    def upload(self, items: Sequence[MissionItem]) -> None:
        answers = self.say(dialect.MAVLink_mission_count_message(self.uav, 1, len(items), 0))
        while requests := of_type(answers, "MISSION_REQUEST_INT"):
            item = items[requests[0].seq]
            item.target_system, item.target_component = self.uav, 1
            answers = self.say(item)
        assert of_type(answers, "MISSION_ACK")[0].type == dialect.MAV_MISSION_ACCEPTED


class VehicleFleet:
    """Vehicles before the start of time, disarmed and without a mission, and their aircraft."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario, self._flight, self._step = scenario, begin(scenario), 0
        controllers = self._flight.controllers
        controllers.uavs["guidance"]["active"] = controllers.uavs["guidance"]["follows"] = 0
        controllers.uavs["guidance"]["start_step"] = NOT_STARTED
        controllers.uavs["profile"]["count"] = 0
        self.members = [
            Member(scenario, uav, Controllers(*(array[i : i + 1] for array in controllers)))
            for i, uav in enumerate(self._flight.ids)
        ]
        self._see()

    def fly(self, seconds: float, on_steps: Callable[[Steps], None] = lambda _: None) -> None:
        """Fly on; every steps flown are told, with their first."""
        until = self._step + round(seconds * 1e6 / self._scenario.step_us)
        end = self._scenario.model_copy(update={"duration_s": until * self._scenario.step_us / 1e6})
        room = room_of(end, 2000)
        part = partial(_part_of, room)
        ending = fly_on(end, self._flight, part, first=self._step, on_steps=on_steps)
        assert ending.loss is None, ending.loss
        self._step = until
        self._see()

    def _see(self) -> None:
        for member, state in zip(self.members, self._flight.fleet.uavs["message"], strict=True):
            member.see(state, self._step)


def _part_of(room: Steps, first: int, end: int) -> Steps:
    return room.part(0, end - first)._replace(first=first)

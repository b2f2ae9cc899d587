"""A vehicle that answers late, on a clock that the test moves."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gcs.station.machine_runner import MachineRunner
from gcs.station.patience import Patience
from gcs.station.subscriptions import Feed
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.command_server import CommandServer
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission_server import MissionServer

GCS, UAV = SystemId(255, 190), SystemId(7, 1)
STEP_S = 0.1  # of the clock

Operation = Callable[[Vehicle], Awaitable[Any]]


class SlowVehicle:
    """A vehicle that handles what it gets only after a while, and beats meanwhile, or does not.

    All on a clock that the test moves: nobody waits.
    """

    def __init__(self, latency_s: float, silent_from_s: float, patience: Patience) -> None:
        self.now = 0.0
        self._latency_s, self._silent_from_s = latency_s, silent_from_s
        self._inbox: list[tuple[float, MAVLink_message]] = []
        self._speaker = FramePacker(*UAV)
        self._speaks = FramePacker(*GCS)
        self.mission = MissionServer(UAV, lambda items: None)
        self._commands = CommandServer(UAV)
        self._beat_s = 0.0
        self.runner = MachineRunner(lambda: self.now, self._send)
        self.state = VehicleState(UAV, 0.0)
        self.vehicle = Vehicle(GCS, self.state, self.runner, lambda _: None, Feed(), patience)

    def _send(self, message: MAVLink_message) -> None:
        received = parse(self._speaks.pack(message))
        assert received is not None
        self._inbox.append((self.now + self._latency_s, received))

    async def until_done(self, operation: Operation) -> Any:
        """Run an operation to its end on the clock."""
        running = asyncio.ensure_future(operation(self.vehicle))
        await asyncio.sleep(0)
        while not running.done():
            self.now += STEP_S
            if self.now < self._silent_from_s:
                self._live()
            self.runner._handle_timer()
            for _ in range(3):
                await asyncio.sleep(0)
        return await running

    def _live(self) -> None:
        if self.now >= self._beat_s:
            self._beat_s += 1.0
            self._say(dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 3, 3))
        due = [message for at, message in self._inbox if at <= self.now]
        self._inbox = [(at, message) for at, message in self._inbox if at > self.now]
        for message in due:
            self._handle(message)

    def _handle(self, message: Any) -> None:
        self.mission.receive(message, self.now)
        self._commands.receive(message, self.now)
        for command in self._commands.events():
            self._commands.finish(command.token, dialect.MAV_RESULT_ACCEPTED, now=self.now)
        if message.get_type().startswith("PARAM_REQUEST"):
            real = dialect.MAV_PARAM_TYPE_REAL32
            self._say(dialect.MAVLink_param_value_message(b"B1", 0.25, real, 1, 0))
        for answer in (*self.mission.messages_to_send(), *self._commands.messages_to_send()):
            self._say(answer)

    def _say(self, message: MAVLink_message) -> None:
        received = parse(self._speaker.pack(message))
        assert received is not None
        self.state.receive(received, self.now)
        self.runner.receive(received, self.now)

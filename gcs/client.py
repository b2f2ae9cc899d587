"""The ground station's MAVLink client: one UDP port, any number of vehicles.

`Client` is the thin shell around the microservice machines of `mavlink_defs`: it owns the
socket, the clock and the record of all that crosses the link. Use it inside a running asyncio
event loop::

    async with Client(parse_address("127.0.0.1:14550")) as client:
        await client.wait_for([1, 2, 3], timeout_s=10.0)
        await client.vehicle(1).upload(segments)
        await client.vehicle(1).command(MAV_CMD_MISSION_START)
"""

import asyncio
import math
import socket
import time
from collections.abc import Callable, Iterable, Sequence
from types import TracebackType
from typing import Any, Self

from gcs.errors import BadInput, GcsError
from mavlink_defs import dialect
from mavlink_defs.command import CommandClient, CommandFinished
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import Address as UdpAddress
from mavlink_defs.endpoint import EndpointError, bind_udp
from mavlink_defs.frames import Speaker, parse
from mavlink_defs.machine import Address, Machine
from mavlink_defs.mission import MissionFinished, MissionUploader
from mavlink_defs.profile import Segment, segments_to_items
from mavlink_defs.tlog import TlogWriter

__all__ = ["Client", "CommandRefused", "NoAnswer", "Vehicle"]

_OWN = Address(255, dialect.MAV_COMP_ID_MISSIONPLANNER)
_HEARTBEAT_S = 1.0


class CommandRefused(GcsError):  # noqa: N818 - the name says it
    """A vehicle answered, but not with ACCEPTED; `result` is its MAV_RESULT or mission result."""

    def __init__(self, text: str, result: int) -> None:
        super().__init__(text)
        self.result = result


class NoAnswer(GcsError):  # noqa: N818 - the name says it
    """A vehicle did not answer in time."""


class Vehicle:
    """One vehicle as the ground station knows it.

    Attributes:
        system: Its system id.
        latest: Last message of each type, by message id.
        texts: Its STATUSTEXTs, oldest first.
    """

    def __init__(self, client: "Client", system: int) -> None:
        self.system = system
        self.latest: dict[int, Any] = {}
        self.texts: list[str] = []
        self._client = client
        self._turn = asyncio.Lock()  # one operation at a time: answers do not say to which
        self._commands = CommandClient(_OWN)

    @property
    def is_ready(self) -> bool:
        """Whether it can be armed, or is: its HEARTBEAT says STANDBY or ACTIVE."""
        heartbeat = self.latest.get(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        return heartbeat is not None and heartbeat.system_status in {
            dialect.MAV_STATE_STANDBY,
            dialect.MAV_STATE_ACTIVE,
        }

    @property
    def _address(self) -> Address:
        return Address(self.system, dialect.MAV_COMP_ID_AUTOPILOT1)

    async def command(self, number: int, params: Iterable[float] = ()) -> None:
        """Send a COMMAND_LONG and wait for its answer.

        Args:
            number: MAV_CMD.
            params: Up to seven parameters; the rest is 0.

        Raises:
            CommandRefused: The answer was not ACCEPTED.
            NoAnswer: There was none, after several tries.
        """
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(*self._address, number, 0, *seven)
        async with self._turn:
            heard = len(self.texts)
            self._commands.send(message, time.monotonic())
            done = await self._client.run(self._commands, CommandFinished)
        name = _enum_name("MAV_CMD", number)
        if done.result is None:
            raise NoAnswer(f"UAV {self.system} did not answer {name}")
        if done.result != dialect.MAV_RESULT_ACCEPTED:
            reason = "".join(f": {text}" for text in self.texts[heard:])
            answer = _enum_name("MAV_RESULT", done.result)
            raise CommandRefused(
                f"UAV {self.system} refused {name} ({answer}){reason}", done.result
            )

    async def upload(self, segments: Sequence[Segment]) -> None:
        """Upload a reference profile by the mission protocol.

        Raises:
            CommandRefused: The vehicle did not accept it; the old profile stays in force.
            NoAnswer: The vehicle did not answer, after several tries.
        """
        items = segments_to_items(segments, *self._address)
        async with self._turn:
            heard = len(self.texts)
            machine = MissionUploader(_OWN, self._address, items)
            machine.start(time.monotonic())
            done = await self._client.run(machine, MissionFinished)
        if done.result is None:
            raise NoAnswer(f"UAV {self.system} did not answer the upload of a profile")
        if done.result != dialect.MAV_MISSION_ACCEPTED:
            reason = "".join(f": {text}" for text in self.texts[heard:])
            answer = _enum_name("MAV_MISSION_RESULT", done.result)
            text = f"UAV {self.system} refused the profile ({answer}){reason}"
            raise CommandRefused(text, done.result)


class Client(asyncio.DatagramProtocol):
    """The ground station's end of the GCS link."""

    def __init__(
        self,
        address: UdpAddress,
        tlog: TlogWriter | None = None,
        on_message: Callable[[MAVLink_message], None] | None = None,
    ) -> None:
        """Prepare a client.

        Args:
            address: Where vehicles send to.
            tlog: Where to record every frame of the link, both directions.
            on_message: Called with every message received.
        """
        self._address = address
        self._tlog = tlog
        self._on_message = on_message
        self._speaker = Speaker(*_OWN)
        self._vehicles: dict[int, Vehicle] = {}
        self._peers: dict[int, tuple[str, int]] = {}
        self._machines: dict[Machine[Any], tuple[type, asyncio.Future[Any]]] = {}
        self._heard = asyncio.Event()  # something has come from a vehicle
        self._timer: asyncio.TimerHandle | None = None
        self._transport: asyncio.DatagramTransport | None = None
        self._heartbeats: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        """Bind the port.

        Raises:
            BadInput: It is in use, or not one of this machine's.
        """
        try:
            sock: socket.socket = bind_udp(self._address, "ground station", "choose another port")
        except EndpointError as problem:
            raise BadInput(str(problem)) from problem
        sock.setblocking(False)
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=sock)
        self._heartbeats = loop.create_task(self._beat())
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the port."""
        if self._heartbeats is not None:
            self._heartbeats.cancel()
        if self._timer is not None:
            self._timer.cancel()
        if self._transport is not None:
            self._transport.close()

    @property
    def vehicles(self) -> dict[int, Vehicle]:
        """Vehicles heard of, by system id."""
        return self._vehicles

    def vehicle(self, system: int) -> Vehicle:
        """A vehicle that has been heard of; KeyError if not."""
        return self._vehicles[system]

    async def wait_for(self, systems: Iterable[int], timeout_s: float) -> None:
        """Wait until every one of these vehicles has been heard and is ready to be armed.

        Raises:
            NoAnswer: Some are not; they are named.
        """
        missing = set(systems)
        end = time.monotonic() + timeout_s
        while missing := {i for i in missing if not self._is_ready(i)}:
            self._heard.clear()
            try:
                async with asyncio.timeout(end - time.monotonic()):
                    await self._heard.wait()
            except TimeoutError:
                names = ", ".join(map(str, sorted(missing)))
                text = f"UAV {names} not ready within {timeout_s:g} s on {self._address}"
                raise NoAnswer(text) from None

    def _is_ready(self, system: int) -> bool:
        vehicle = self._vehicles.get(system)
        return vehicle is not None and vehicle.is_ready

    async def run(self, machine: Machine[Any], finished: type) -> Any:
        """Drive a machine that has been started until its event of type `finished`."""
        future = asyncio.get_running_loop().create_future()
        self._machines[machine] = (finished, future)
        try:
            self._pump()
            return await future
        finally:
            del self._machines[machine]

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take in a datagram; called by asyncio."""
        message = parse(data)
        if message is None:
            return
        if self._tlog is not None:
            self._tlog.write(data, time.time_ns() // 1000)
        system = message.get_srcSystem()
        self._peers[system] = addr
        if system not in self._vehicles and message.get_msgId() == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            self._vehicles[system] = Vehicle(self, system)
        vehicle = self._vehicles.get(system)
        if vehicle is not None:
            vehicle.latest[message.get_msgId()] = message
            if isinstance(message, dialect.MAVLink_statustext_message):
                vehicle.texts.append(str(message.text))
        self._heard.set()
        now = time.monotonic()
        for machine in list(self._machines):
            machine.receive(message, now)
        if self._machines:
            self._pump()
        if self._on_message is not None:
            self._on_message(message)

    async def _beat(self) -> None:
        while True:
            heartbeat = dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0,
                dialect.MAV_STATE_ACTIVE, 3,
            )  # fmt: skip
            self._send(heartbeat, self._peers.values())
            await asyncio.sleep(_HEARTBEAT_S)

    def _send(self, message: MAVLink_message, peers: Iterable[tuple[str, int]]) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        frame = self._speaker.pack(message)
        if self._tlog is not None:
            self._tlog.write(frame, time.time_ns() // 1000)
        for peer in peers:
            self._transport.sendto(frame, peer)

    def _pump(self) -> None:
        """Send what the machines want sent, deliver what has happened, set the next alarm."""
        deadline = math.inf
        for machine, (finished, future) in list(self._machines.items()):
            for message in machine.messages_to_send():
                peer = self._peers.get(getattr(message, "target_system", 0))
                self._send(message, [peer] if peer else [])
            for event in machine.events():
                if isinstance(event, finished) and not future.done():
                    future.set_result(event)
            deadline = min(deadline, machine.deadline() or math.inf)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if deadline < math.inf:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(max(deadline - time.monotonic(), 0.0), self._ring)

    def _ring(self) -> None:
        now = time.monotonic()
        for machine in list(self._machines):
            machine.handle_timer(now)
        self._pump()


def _enum_name(enum: str, value: int) -> str:
    entry = dialect.enums[enum].get(value)
    return entry.name if entry is not None else f"{enum} {value}"

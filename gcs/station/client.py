"""The ground station's MAVLink client: one UDP port, any number of vehicles.

`Client` is the thin shell around the known state of the vehicles (`FleetState`) and the
microservice machines of `mavlink_defs`: it owns the socket, the clock and the log of the
link's traffic. Use it inside a running asyncio event loop::

    async with Client(parse_connection("udpin:127.0.0.1:14550")) as client:
        await client.wait_for([1, 2, 3], timeout_s=10.0)
        await client.vehicle(1).upload_profile(segments)
        await client.vehicle(1).start_mission()
"""

import asyncio
import contextlib
import select
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable
from typing import Self

from gcs.console.errors import BadInput, NoAnswer, bad_endpoint
from gcs.station.fleet_state import FleetState
from gcs.station.inquiries import Inquiries
from gcs.station.machine_runner import MachineRunner
from gcs.station.notifications import ERROR, Notification
from gcs.station.patience import ENDLESS, HASTY, USUAL, Patience
from gcs.station.subscriptions import Feed
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import Connection, EndpointError, bind_udp, connect_udp
from mavlink_defs.framing.frames import FramePacker, drop_reason, frame_size, parse
from mavlink_defs.framing.header import COMPONENT, HEADER_SIZE, MESSAGE_ID, SYSTEM
from mavlink_defs.framing.key_file import load_signer
from mavlink_defs.framing.signing import SigningError
from mavlink_defs.services.machine import SystemId

GROUND_STATION = SystemId(255, dialect.MAV_COMP_ID_MISSIONPLANNER)
_AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1
_TICK_S = 0.2
_HEARTBEAT_S = 1.0
_MAX_DATAGRAM = 65535
_DISCOVERY_S = 1.2  # every vehicle sends a HEARTBEAT within a second
_FLEET_S = 3.0  # for the answer to which fleet a vehicle is of; others than ours answer, too
_MEMBERS_S = 5.0  # for members of the fleet that are not heard at once
_NOTIFICATIONS_KEPT = 2000
_MAX_DATAGRAMS = 64
"""Most datagrams processed at a time: a turn of the event loop costs as much as a datagram."""
_SHARE_HINT = "go through the hub of `gcs up` with --connect udpout:HOST:PORT"


class Client(asyncio.DatagramProtocol):
    """The ground station's end of the GCS link; an async context manager.

    Attributes:
        own: System and component id that it sends as.
        connection: Its connection to the vehicles.
        fleet: The known state of the vehicles.
        machines: Runs the microservice machines of all vehicles.
        log: The latest notifications, oldest first.
        received: Passes on every message, after `fleet` has processed it.
        notified: Passes on every notification.
        unreachable: Whether nobody listens at the address of an outgoing connection.
        drops: Datagrams that were dropped here, by reason.
        now: The clock [s].
    """

    def __init__(
        self,
        connection: Connection,
        *,
        tlog: TlogWriter | None = None,
        on_message: Callable[[MAVLink_message], None] | None = None,
        on_notification: Callable[[Notification], None] | None = None,
        inquire: bool = False,
        private: bool = False,
        only_recorded: Collection[int] = (),
        own: SystemId = GROUND_STATION,
        signing_key: str | None = None,
        patience: Patience = USUAL,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare a client.

        Args:
            connection: Connection to the vehicles.
            tlog: Where to record every frame of the link, both directions.
            on_message: Called with every message received, after `fleet` has processed it.
            on_notification: Called with all notifications.
            inquire: Request faults and profile of every vehicle, and again whenever they may have
                changed.
            private: Request the private messages (errors, events, estimates, drops), which
                vehicles stream only on request.
            only_recorded: Ids of messages that are of no use here: once their vehicle is known they
                are recorded, and show that it lives, but are not decoded.
            own: System and component id. Ground stations that talk to the same vehicles at the
                same time should have different ones.
            signing_key: Key file; with one, unsigned frames are refused.
            patience: How long operations on vehicles wait for answers; ENDLESS: inquiries, too.
            clock: Returns the time [s].

        Raises:
            BadInput: The key cannot be used.
        """
        self.own = own
        self.connection = connection
        self.fleet = FleetState()
        self.log: deque[Notification] = deque(maxlen=_NOTIFICATIONS_KEPT)
        self.received, self.notified = Feed(on_message), Feed(on_notification)
        self.unreachable = False
        self.drops: Counter[str] = Counter()
        self._tlog = tlog
        self._failure: OSError | None = None
        self._private = private
        self._only_recorded = frozenset(only_recorded)
        self._packer = FramePacker(*own)
        try:
            self.signer = load_signer(signing_key)
        except SigningError as problem:
            raise BadInput(str(problem)) from None
        self._vehicles: dict[int, Vehicle] = {}
        self._peers: dict[int, tuple[str, int]] = {}
        self.now = clock
        self.machines = MachineRunner(clock, self._send_to_target)
        self._heard = asyncio.Event()  # a vehicle has sent something, or is unreachable
        self._sock: socket.socket | None = None
        self._transport: asyncio.DatagramTransport | None = None
        self._pulse: asyncio.Task[None] | None = None
        self._patience = patience
        inquiring = patience if patience is ENDLESS else HASTY
        self._inquiries = Inquiries(private=private, rest=inquire, patience=inquiring)

    async def __aenter__(self) -> Self:
        """Open the port.

        Raises:
            BadInput: It is in use, or the address cannot be used.
        """
        address = self.connection.address
        try:
            if self.connection.direction == "in":
                sock = bind_udp(address, "ground station", _SHARE_HINT)
            else:
                sock = connect_udp(address)
        except EndpointError as problem:
            raise bad_endpoint(problem) from problem
        sock.setblocking(False)
        self._sock = sock
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=sock)
        self._pulse = loop.create_task(self._live())
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close the port."""
        if self._pulse is not None:
            self._pulse.cancel()
            await asyncio.gather(self._pulse, return_exceptions=True)
        await self._inquiries.close()
        self.machines.close()
        self.received.end()
        self.notified.end()
        if self._transport is not None:
            self._transport.close()

    # vehicles

    @property
    def vehicles(self) -> dict[int, Vehicle]:
        """Vehicles heard, by system id in ascending order."""
        return dict(sorted(self._vehicles.items()))

    def vehicle(self, system: int) -> Vehicle:
        """Return a vehicle that has been heard; KeyError if there is none."""
        return self._vehicles[system]

    async def wait_for(self, systems: Iterable[int], timeout_s: float) -> None:
        """Wait until all these vehicles have been heard and are ready to be armed.

        If private messages are requested, wait until they arrive, too.

        Args:
            systems: System ids of the vehicles.
            timeout_s: Longest time in which none of them becomes ready [s]; how long all take
                depends on their number and on the machine.

        Raises:
            NoAnswer: Some are not ready; they are named.
        """
        expected = set(systems)
        while before := self.not_ready(expected):
            if not await self.until(lambda: self.not_ready(expected) != before, timeout_s):
                names = ", ".join(map(str, sorted(before)))
                raise NoAnswer(f"UAV {names} not ready within {timeout_s:g} s on {self.connection}")

    def not_ready(self, systems: Iterable[int]) -> set[int]:
        """Return the vehicles that have not been heard or are not ready, as of `wait_for`."""

        def is_complete(vehicle: Vehicle | None) -> bool:
            if vehicle is None or not vehicle.state.is_ready:
                return False
            state = vehicle.state
            return state.tells_private or not (self._private and state.offers_private)

        return {i for i in systems if not is_complete(self._vehicles.get(i))}

    async def discover(
        self, timeout_s: float, systems: Collection[int] | None = None, *, whole: bool = True
    ) -> list[Vehicle]:
        """Wait until these vehicles, or all that seem to exist, have been heard; return them.

        Args:
            timeout_s: Longest wait [s].
            systems: System ids of the vehicles; None: all.
            whole: With all, ask them for the other members of their fleet, and wait for these,
                too (at most 5 s). Vehicles that know of no fleet are taken as they are heard.

        Raises:
            NoAnswer: No vehicle was heard, or one of `systems` or of the fleet was not.
        """
        begin = self.now()

        def complete() -> bool:
            if systems is not None:
                return self._vehicles.keys() >= set(systems)
            waited = self.now() - begin >= _DISCOVERY_S
            return waited and bool(self._vehicles) and not self.fleet.unconfirmed

        heard = await self.until(lambda: complete() or self.unreachable, timeout_s)
        if self.unreachable:
            raise NoAnswer(f"nobody listens at {self.connection.address} ({self.connection})")
        if systems is not None and not heard:
            names = ", ".join(str(i) for i in sorted(systems) if i not in self._vehicles)
            raise NoAnswer(f"UAV {names} not heard within {timeout_s:g} s on {self.connection}")
        if not self._vehicles:
            raise NoAnswer(f"no vehicle heard within {timeout_s:g} s on {self.connection}")
        if systems is None and whole:
            await self._hear_the_fleet(min(timeout_s, _MEMBERS_S))
        return [v for i, v in self.vehicles.items() if systems is None or i in systems]

    async def _hear_the_fleet(self, timeout_s: float) -> None:
        """Wait until all members of the fleet of the vehicles heard have been heard."""
        asking = [vehicle.ask_for_fleet() for vehicle in self.vehicles.values()]
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_FLEET_S):
                await asyncio.gather(*asking)
        if not await self.until(lambda: not self.fleet.missing, timeout_s):
            names = ", ".join(map(str, self.fleet.missing))
            text = f"UAV {names} of the fleet not heard within {timeout_s:g} s"
            raise NoAnswer(f"{text} on {self.connection}")

    def check(self) -> None:
        """Raise the error that stopped the recording of the link, if any.

        Raises:
            OSError: The log could not be written.
        """
        if self._failure is not None:
            raise self._failure

    async def until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until a condition holds; return False if it still does not after the timeout.

        Raises:
            OSError: As of `check`.
        """
        end = self.now() + timeout_s
        while not condition():
            self.check()
            self._heard.clear()
            if (left := end - self.now()) <= 0.0:
                return False
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(min(left, _TICK_S)):
                    await self._heard.wait()
        return True

    async def catch_up(self, timeout_s: float) -> None:
        """Take in all that has arrived so far, for at most `timeout_s` if more keeps coming."""
        if self._transport is None:
            return
        sock, end = self._transport.get_extra_info("socket"), self.now() + timeout_s
        while select.select([sock], [], [], 0.0)[0] and self.now() < end:
            await asyncio.sleep(0.0)

    # the link

    def emit(self, notifications: Iterable[Notification]) -> None:
        """Add notifications to the log."""
        for one in notifications:
            self.log.append(one)
            self.notified.put(one)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Process a datagram, and others that have arrived with it; called by asyncio."""
        self._receive(data, addr)
        if self._sock is None:
            return
        for _ in range(_MAX_DATAGRAMS):
            try:
                more = self._sock.recvfrom(_MAX_DATAGRAM)
            except OSError:  # none is left; an error is reported again to asyncio
                return
            self._receive(*more)

    def _receive(self, data: bytes, addr: tuple[str, int]) -> None:
        wrong = None if self.signer is None else self.signer.problem(data)
        if wrong is None and (sender := self._known_sender(data)) is not None:
            self._record(data)
            self.emit(sender.note_heard(self.now()))
            return
        message = parse(data) if wrong is None else None
        if message is None:
            self.drops[(wrong or drop_reason(data)).text] += 1
            return
        self._record(data)
        self.unreachable = False
        now, system = self.now(), message.get_srcSystem()
        if system not in self._peers or message.get_srcComponent() == _AUTOPILOT:
            self._peers[system] = addr
        self.emit(self.fleet.receive(message, now))
        if system not in self._vehicles and system in self.fleet.vehicles:
            self._vehicles[system] = Vehicle(
                self.own,
                self.fleet.vehicles[system],
                self.machines,
                self.emit,
                self.received,
                self._patience,
            )
            self._inquiries.start(self._vehicles.values(), now)
        self._heard.set()
        self.machines.receive(message, now)
        self.received.put(message)

    def _known_sender(self, data: bytes) -> VehicleState | None:
        """Return the vehicle that an intact frame comes from if it is only to be recorded."""
        if int.from_bytes(data[MESSAGE_ID:HEADER_SIZE], "little") not in self._only_recorded:
            return None
        state = self.fleet.vehicles.get(data[SYSTEM])
        if state is None or state.address != (data[SYSTEM], data[COMPONENT]):
            return None
        return state if frame_size(data)[0] == len(data) else None

    def error_received(self, exc: Exception) -> None:
        """Note that nobody listens at the other end; called by asyncio."""
        if isinstance(exc, ConnectionRefusedError) and not self.unreachable:
            self.unreachable = True
            text = f"nobody listens at {self.connection.address}"
            self.emit([Notification(self.now(), 0, "link", ERROR, text)])
            self._heard.set()

    async def _live(self) -> None:
        """Handle everything due by the clock: heartbeats, lost links, requests."""
        beat_due = 0.0
        while True:
            now = self.now()
            if now >= beat_due:
                beat_due = now + _HEARTBEAT_S
                self._send(_heartbeat(), set(self._peers.values()))
            self.emit(self.fleet.handle_timer(now))
            self._inquiries.start(self._vehicles.values(), now)
            await asyncio.sleep(_TICK_S)

    def _send_to_target(self, message: MAVLink_message) -> None:
        peer = self._peers.get(getattr(message, "target_system", 0))
        self._send(message, [peer] if peer else [])

    def _send(self, message: MAVLink_message, peers: Collection[tuple[str, int]]) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        frame = self._packer.pack(message)
        if self.signer is not None:
            frame = self.signer.sign(frame)
        self._record(frame)
        if self.connection.direction == "out":
            self._transport.sendto(frame)
            return
        for peer in peers:
            self._transport.sendto(frame, peer)

    def _record(self, frame: bytes) -> None:
        if self._tlog is None or self._failure is not None:
            return
        try:
            self._tlog.write(frame, time.time_ns() // 1000)
        except OSError as problem:
            self._failure = problem


def _heartbeat() -> MAVLink_message:
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )

"""The ground station's MAVLink client: one UDP port, any number of vehicles.

`Client` is the thin shell around what the ground station knows (`FleetState`) and the
microservice machines of `mavlink_defs`: it owns the socket, the clock and the record of all
that crosses the link. Use it inside a running asyncio event loop::

    async with Client(parse_connection("udpin:127.0.0.1:14550")) as client:
        await client.wait_for([1, 2, 3], timeout_s=10.0)
        await client.vehicle(1).upload(segments)
        await client.vehicle(1).start_mission()
"""

import asyncio
import contextlib
import math
import select
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Collection, Coroutine, Iterable
from types import TracebackType
from typing import Any, Self, TypeVar

from gcs.errors import BadInput, NoAnswer, bad_endpoint
from gcs.station.fleet_state import FleetState
from gcs.station.notifications import ERROR, Notification
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import Connection, EndpointError, bind_udp, connect_udp
from mavlink_defs.framing.frames import FramePacker, drop_reason, parse
from mavlink_defs.framing.signing import SigningError, load_signer
from mavlink_defs.services.machine import Machine, SystemId

__all__ = ["GROUND_STATION", "Client"]

GROUND_STATION = SystemId(255, dialect.MAV_COMP_ID_MISSIONPLANNER)
_AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1
_TICK_S = 0.2
_HEARTBEAT_S = 1.0
_DISCOVERY_S = 1.2  # every vehicle sends a HEARTBEAT within a second
_NOTIFICATIONS_KEPT = 2000
_SHARE_HINT = "go through the hub of `gcs up` with --connect udpout:HOST:PORT"


E = TypeVar("E")  # events of a machine
F = TypeVar("F")  # the last one


class Client(asyncio.DatagramProtocol):
    """The ground station's end of the GCS link; an async context manager.

    Attributes:
        own: System and component id that it sends as.
        connection: How it meets the vehicles.
        fleet: What is known of the vehicles.
        log: The latest notifications, oldest first.
        unreachable: Whether nobody listens where an outgoing connection leads.
        drops: Datagrams that were dropped here, by reason in words.
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
        own: SystemId = GROUND_STATION,
        signing_key: str | None = None,
    ) -> None:
        """Prepare a client.

        Args:
            connection: How to meet the vehicles.
            tlog: Where to record every frame of the link, both directions.
            on_message: Called with every message received, after `fleet` knows of it.
            on_notification: Called with all notifications.
            inquire: Ask every vehicle for its faults and its profile, and again whenever they
                may have changed.
            private: Let every vehicle stream its private messages (errors, events, estimates,
                drops), which it does not do on its own.
            own: System and component id. Ground stations that talk to the same vehicles at the
                same time should have different ones.
            signing_key: Key file; with one, unsigned frames are refused.

        Raises:
            BadInput: The key cannot be used.
        """
        self.own = own
        self.connection = connection
        self.fleet = FleetState()
        self.log: deque[Notification] = deque(maxlen=_NOTIFICATIONS_KEPT)
        self.unreachable = False
        self.drops: Counter[str] = Counter()
        self._tlog = tlog
        self._failure: OSError | None = None
        self._on_message, self._on_notification = on_message, on_notification
        self._inquire, self._private = inquire, private
        self._packer = FramePacker(*own)
        try:
            self.signer = load_signer(signing_key)
        except SigningError as problem:
            raise BadInput(str(problem)) from None
        self._vehicles: dict[int, Vehicle] = {}
        self._peers: dict[int, tuple[str, int]] = {}
        self._machines: dict[Machine[Any], Callable[[Any], None]] = {}
        self._turns: defaultdict[tuple[int, str], asyncio.Lock] = defaultdict(asyncio.Lock)
        self._heard = asyncio.Event()  # something has come from a vehicle, or cannot come
        self._timer: asyncio.TimerHandle | None = None
        self._transport: asyncio.DatagramTransport | None = None
        self._pulse: asyncio.Task[None] | None = None
        self._inquiries: dict[tuple[int, str], asyncio.Task[None]] = {}

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
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=sock)
        self._pulse = loop.create_task(self._live())
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the port."""
        tasks = [task for task in (self._pulse, *self._inquiries.values()) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if self._timer is not None:
            self._timer.cancel()
        if self._transport is not None:
            self._transport.close()

    # vehicles

    @property
    def vehicles(self) -> dict[int, Vehicle]:
        """Vehicles heard of, by system id in ascending order."""
        return dict(sorted(self._vehicles.items()))

    def vehicle(self, system: int) -> Vehicle:
        """A vehicle that has been heard of; KeyError if not."""
        return self._vehicles[system]

    async def wait_for(self, systems: Iterable[int], timeout_s: float) -> None:
        """Wait until every one of these vehicles has been heard and is ready to be armed.

        If private messages are wanted, they come then.

        Raises:
            NoAnswer: Some are not; they are named.
        """
        wanted = set(systems)

        def is_complete(vehicle: Vehicle | None) -> bool:
            if vehicle is None or not vehicle.state.is_ready:
                return False
            state = vehicle.state
            return state.tells_private or not (self._private and state.offers_private)

        def missing() -> set[int]:
            return {i for i in wanted if not is_complete(self._vehicles.get(i))}

        if not await self.until(lambda: not missing(), timeout_s):
            names = ", ".join(map(str, sorted(missing())))
            raise NoAnswer(f"UAV {names} not ready within {timeout_s:g} s on {self.connection}")

    async def discover(
        self, timeout_s: float, systems: Collection[int] | None = None
    ) -> list[Vehicle]:
        """Wait until these vehicles, or all that there seem to be, have been heard.

        Raises:
            NoAnswer: No vehicle, or one of `systems`, was not heard.
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
        return [v for i, v in self.vehicles.items() if systems is None or i in systems]

    def check(self) -> None:
        """Notice that what crosses the link can no longer be recorded.

        Raises:
            OSError: Of writing the log.
        """
        if self._failure is not None:
            raise self._failure

    async def until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait for a condition that messages or time bring about; False if it stays untrue.

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

    # what vehicles need of their link

    def now(self) -> float:
        """The client's clock [s]."""
        return time.monotonic()

    def emit(self, notifications: Iterable[Notification]) -> None:
        """Put notifications into the log."""
        for one in notifications:
            self.log.append(one)
            if self._on_notification is not None:
                self._on_notification(one)

    async def run(
        self,
        turn: tuple[int, str],
        machine: Machine[E],
        start: Callable[[float], None],
        finished: type[F],
        on_event: Callable[[E], None] | None = None,
        stop: Callable[[float], None] | None = None,
    ) -> F:
        """Start a machine when its turn comes and drive it until an event of type `finished`.

        Args:
            turn: System and service: machines of the same one wait for each other, because
                answers do not say which request they are for.
            machine: The machine.
            start: Called with the time to start it.
            finished: Type of its last event, which is returned.
            on_event: Called with its other events.
            stop: Called with the time if the caller loses patience.
        """
        future: asyncio.Future[F] = asyncio.get_running_loop().create_future()

        def deliver(event: E) -> None:
            if isinstance(event, finished) and not future.done():
                future.set_result(event)
            elif on_event is not None:
                on_event(event)

        async with self._turns[turn]:
            self._machines[machine] = deliver
            try:
                start(self.now())
                self._pump()
                return await future
            finally:
                if not future.done() or future.cancelled():
                    if stop is not None:
                        stop(self.now())
                    self._pump()  # what the machine has to send at its end
                del self._machines[machine]

    # the link

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take in a datagram; called by asyncio."""
        wrong = None if self.signer is None else self.signer.problem(data)
        message = parse(data) if wrong is None else None
        if message is None:
            self.drops[(wrong or drop_reason(data)).words] += 1
            return
        self._record(data)
        self.unreachable = False
        now, system = self.now(), message.get_srcSystem()
        if system not in self._peers or message.get_srcComponent() == _AUTOPILOT:
            self._peers[system] = addr
        self.emit(self.fleet.receive(message, now))
        if system not in self._vehicles and system in self.fleet.vehicles:
            self._vehicles[system] = Vehicle(self, self.fleet.vehicles[system])
            self._ask_what_is_due(now)
        self._heard.set()
        for machine in list(self._machines):
            machine.receive(message, now)
        if self._machines:
            self._pump()
        if self._on_message is not None:
            self._on_message(message)

    def error_received(self, exc: Exception) -> None:
        """Note that nobody listens at the other end; called by asyncio."""
        if isinstance(exc, ConnectionRefusedError) and not self.unreachable:
            self.unreachable = True
            text = f"nobody listens at {self.connection.address}"
            self.emit([Notification(self.now(), 0, "link", ERROR, text)])
            self._heard.set()

    async def _live(self) -> None:
        """Do what is due by the clock: heartbeats, silence, inquiries."""
        beat_due = 0.0
        while True:
            now = self.now()
            if now >= beat_due:
                beat_due = now + _HEARTBEAT_S
                self._send(_heartbeat(), set(self._peers.values()))
            self.emit(self.fleet.handle_timer(now))
            self._ask_what_is_due(now)
            await asyncio.sleep(_TICK_S)

    def _ask_what_is_due(self, now: float) -> None:
        for vehicle in self._vehicles.values():
            if self._private and vehicle.state.is_private_due(now):
                self._start_asking(vehicle, "private", vehicle.ask_for_private)
            if self._inquire and vehicle.state.is_asking_due(now):
                self._start_asking(vehicle, "rest", vehicle.ask_what_is_due)

    def _start_asking(
        self, vehicle: Vehicle, what: str, ask: Callable[[], Coroutine[Any, Any, None]]
    ) -> None:
        before = self._inquiries.get((vehicle.system, what))
        if before is None or before.done():
            task = asyncio.get_running_loop().create_task(ask())
            self._inquiries[vehicle.system, what] = task

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

    def _pump(self) -> None:
        """Send what the machines want sent, deliver what has happened, set the next alarm."""
        deadline = math.inf
        for machine, deliver in list(self._machines.items()):
            for message in machine.messages_to_send():
                peer = self._peers.get(getattr(message, "target_system", 0))
                self._send(message, [peer] if peer else [])
            for event in machine.events():
                deliver(event)
            deadline = min(deadline, machine.deadline() or math.inf)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if deadline < math.inf:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(max(deadline - self.now(), 0.0), self._ring)

    def _ring(self) -> None:
        now = self.now()
        for machine in list(self._machines):
            machine.handle_timer(now)
        self._pump()


def _heartbeat() -> MAVLink_message:
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )

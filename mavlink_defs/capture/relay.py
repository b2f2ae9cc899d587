"""The relay: sits in front of the fixed ends of links, counts, and impairs on request.

A link has a fixed end, whose port is known (the plant, a ground station, an autopilot's formation
port), and peers that send to it. They send to the relay's port instead. Every peer gets a socket
of its own towards the fixed end, so that the fixed end can distinguish and answer them. A peer
that is a fixed end itself, as autopilots are to their neighbours, needs none: its datagrams come
from the port where the relay listens in its place, which is where the receiver would answer.
Datagrams are counted as they come in, before anything happens to them.

A compiled loop (`mavlink_defs.capture.relay_loop`) passes them on, on a thread that has the
interpreter only when a peer is new, a table is full, or a gate is asked.
"""

import contextlib
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Self

from mavlink_defs.capture import relay_loop
from mavlink_defs.capture.impairing import Fate, new_directions
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.capture.tap import Tap
from mavlink_defs.capture.tap_report import OutcomeReport, TapReport
from mavlink_defs.endpoint import EndpointError, UdpAddress, bind_udp, connect_udp, resolve
from mavlink_defs.runtime.sockaddr import sockaddr

_MAX_PEERS = 256  # of one route; of more, the one without traffic for longest is forgotten
_DIRECTIONS = ("to", "from")


@dataclass(frozen=True)
class Route:
    """One fixed end, and where the relay listens in its place.

    Attributes:
        link: Name of the link; several routes may have the same.
        listen: Where the relay receives; port 0 lets the system choose.
        target: The fixed end.
        impairment: Impairment of datagrams in transit, in both directions.
    """

    link: str
    listen: UdpAddress
    target: UdpAddress
    impairment: Impairment | None = None


class Relay:
    """Relays while its context is entered, on a thread of its own.

    Args:
        routes: What to sit in front of.
        tap: Counts everything; its times are seconds since the relay was started.
        simulated: Outages are in simulation time, as FTC_SIM_STATE on a relayed link shows it
            (none before it runs); otherwise in seconds since the relay was started.
        gate: Asked with link, direction and content of each datagram whether it passes; one that
            does not is neither counted nor delivered. Called on the relay's thread.
    """

    def __init__(
        self,
        routes: Sequence[Route],
        tap: Tap | None = None,
        simulated: bool = False,
        gate: Callable[[str, str, bytes], bool] | None = None,
    ) -> None:
        self._routes, self._simulated = routes, simulated
        self._tap = tap or Tap()
        self._gate = gate
        self._targets: list[UdpAddress] = []
        self._fronts: list[socket.socket] = []
        self._upstream: dict[int, socket.socket] = {}  # by row of the peer
        self._wakers: tuple[socket.socket, ...] = ()  # what the first sends wakes the loop
        self._start_s = 0.0
        self._lock = threading.Lock()  # held while the loop runs, or its state is read
        self._one_at_a_time = threading.Lock()
        self._may_run = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)

    def __enter__(self) -> Self:
        """Open the ports and start.

        Raises:
            EndpointError: A port or a target is unavailable; nothing is open then.
        """
        try:
            for route in self._routes:
                target = resolve(route.target)
                connect_udp(target).close()  # fails now if it cannot be reached
                sock = bind_udp(route.listen, f"relay of the {route.link} link")
                sock.setblocking(False)
                self._targets.append(target)
                self._fronts.append(sock)
            if self._routes:
                self._start()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Stop; datagrams still in transit are lost."""
        self._closing.set()
        if self._routes:
            self._pause()
            self._thread.join()
        self._close()

    @property
    def via(self) -> dict[str, str]:
        """Addresses to send to, as host:port, in place of each target."""
        listening = (UdpAddress(*sock.getsockname()) for sock in self._fronts)
        return {str(r.target): str(at) for r, at in zip(self._routes, listening, strict=True)}

    def report(self) -> TapReport:
        """Return the tap's report, with what became of each direction's datagrams."""
        with self.counting() as tap:
            report = tap.report(time.monotonic() - self._start_s)
            return replace(report, fates=self._fates())

    @contextlib.contextmanager
    def counting(self) -> Iterator[Tap]:
        """Lend the tap, which counts nothing while the context lasts; so keep it short."""
        with self._one_at_a_time:
            self._may_run.clear()
            if self._routes:
                self._pause()
            try:
                with self._lock:
                    yield self._tap
            finally:
                self._may_run.set()

    def _start(self) -> None:
        self._wakers = socket.socketpair()
        for sock in self._wakers:
            sock.setblocking(False)
        self._state = self._new_state()
        relay_loop.pause(self._state)
        relay_loop.run(self._state, self._tap.counts)  # compiled before anything arrives
        self._start_s = self._state.state[0]["start_s"] = time.monotonic()
        self._may_run.set()
        self._thread.start()

    def _new_state(self) -> relay_loop.RelayState:
        ways = [
            (route, f"{route.link}/{i}/{direction}", direction)
            for i, route in enumerate(self._routes)
            for direction in _DIRECTIONS
        ]
        fronts = zip(self._fronts, self._targets, strict=True)
        state = relay_loop.new_relay_state(
            self._wakers[1].fileno(),
            [(sock.fileno(), sockaddr(target)) for sock, target in fronts],
            [self._tap.flow(route.link, direction) for route, _, direction in ways],
            [route.impairment is not None for route, _, _ in ways],
            new_directions([(route.impairment or Impairment(), path) for route, path, _ in ways]),
        )
        state.state[0]["simulated"] = self._simulated
        state.state[0]["gated"] = self._gate is not None
        return state

    def _fates(self) -> tuple[OutcomeReport, ...]:
        fates: dict[tuple[str, str], Counter[str]] = {}
        for number, way in enumerate(self._state.ways if self._routes else ()):
            route, direction = self._routes[number // 2], _DIRECTIONS[number % 2]
            counts = fates.setdefault((route.link, direction), Counter())
            counts["undeliverable"] += int(way["undeliverable"])
            if route.impairment is not None:
                fate = Fate.of(self._state.directions.fates[number])
                counts.update(asdict(fate), delivered=fate.delivered)
        return tuple(OutcomeReport(*key, dict(counts)) for key, counts in sorted(fates.items()))

    def _run(self) -> None:
        while not self._closing.is_set():
            self._may_run.wait()
            with self._lock:
                need = relay_loop.run(self._state, self._tap.counts)
                if need == relay_loop.Need.PEER:
                    self._meet_peer()
                elif need == relay_loop.Need.ROOM:
                    self._tap.make_room(int(self._state.state[0]["length"]))
                    self._state = relay_loop.make_room(self._state)
            if need == relay_loop.Need.PAUSE:
                with contextlib.suppress(BlockingIOError):
                    self._wakers[1].recv(4096)
            elif need == relay_loop.Need.GATE:
                self._ask_gate()

    def _pause(self) -> None:
        """Make the loop return."""
        with contextlib.suppress(OSError):  # enough such requests are pending, or it is closed
            self._wakers[0].send(b"!")

    def _ask_gate(self) -> None:
        assert self._gate is not None
        state = self._state.state[0]
        way = self._way(int(state["from_row"]))
        datagram = self._state.received[: state["length"]].tobytes()
        if self._gate(self._routes[way // 2].link, _DIRECTIONS[way % 2], datagram):
            state["allowed"] = 1
        else:
            state["length"] = -1

    def _way(self, row: int) -> int:
        """Return the way of a datagram, by the row of the socket from which it came."""
        front = row - relay_loop.FIRST_FRONT
        if front < len(self._fronts):
            return 2 * front
        return 2 * int(self._state.peers[front - len(self._fronts)]["front"]) + 1

    def _meet_peer(self) -> None:
        """Open a socket for the sender of the datagram that was received."""
        state = self._state.state[0]
        front = int(state["from_row"]) - relay_loop.FIRST_FRONT
        rows = relay_loop.peers_of(self._state, front)
        if len(rows) >= _MAX_PEERS:
            self._state = relay_loop.forget_peer(self._state, int(rows[0]))
            self._upstream.pop(int(rows[0])).close()
        try:
            sock = connect_udp(self._targets[front])
        except (EndpointError, OSError):  # no route any more, too many open files
            self._state.ways[2 * front]["undeliverable"] += 1
            state["length"], state["allowed"] = -1, 0
            return
        sock.setblocking(False)
        self._state, row = relay_loop.free_row(self._state)
        self._upstream[row] = sock
        self._state = relay_loop.add_peer(self._state, row, front, sock.fileno())

    def _close(self) -> None:
        for sock in (*self._fronts, *self._upstream.values(), *self._wakers):
            sock.close()

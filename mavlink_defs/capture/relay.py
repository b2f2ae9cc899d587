"""The relay: stands in front of the fixed ends of links, counts, and impairs on request.

A link has a fixed end, whose port is known (the plant, a ground station, an autopilot's formation
port), and peers that send to it. They send to the relay's port instead. Every peer gets a socket
of its own towards the fixed end, so that the fixed end can distinguish and answer them. A peer
that is a fixed end itself, as autopilots are to their neighbours, needs none: its datagrams come
from the port where the relay listens in its place, which is where the receiver would answer.
Datagrams are counted as they come in, before anything happens to them.
"""

import contextlib
import heapq
import itertools
import selectors
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, Self

from mavlink_defs.capture.impairment import Impairer, Impairment
from mavlink_defs.capture.tap import Tap
from mavlink_defs.capture.tap_report import OutcomeReport, TapReport
from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp, resolve

__all__ = ["Relay", "Route"]

_LOOK_S = 0.05
_MAX_PEERS = 256  # of one route; of more, the one without traffic for longest is forgotten
_LONGEST_DATAGRAM = 65535


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


class _Way:
    """One direction of a route."""

    def __init__(self, route: Route, number: int, direction: str) -> None:
        self.link, self.direction = route.link, direction
        self.undeliverable = 0
        path = f"{route.link}/{number}/{direction}"
        self.impairer = Impairer(route.impairment, path) if route.impairment else None


@dataclass(frozen=True)
class _Front:
    """Address that peers send to."""

    sock: socket.socket
    route: Route
    target: tuple[str, int]
    to: _Way
    back: _Way
    peers: dict[tuple[str, int], socket.socket]  # in order of their last datagram


class Relay:
    """Relays while its context is entered, on a thread of its own.

    Args:
        routes: What to stand in front of.
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
        self._lock = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._fronts: list[_Front] = []
        self._in_place_of: dict[tuple[str, int], _Front] = {}
        self._queue: list[tuple[float, int, _Way, socket.socket, Any, bytes]] = []
        self._order = itertools.count()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)
        self._start_s = 0.0

    def __enter__(self) -> Self:
        """Open the ports and start.

        Raises:
            EndpointError: A port or a target is unavailable; nothing is open then.
        """
        try:
            for i, route in enumerate(self._routes):
                target = resolve(route.target)
                connect_udp(target).close()  # fails now if it cannot be reached
                sock = bind_udp(route.listen, f"relay of the {route.link} link")
                sock.setblocking(False)
                ways = _Way(route, i, "to"), _Way(route, i, "from")
                front = _Front(sock, route, (target.host, target.port), *ways, {})
                self._fronts.append(front)
                self._in_place_of[front.target] = front
                self._selector.register(sock, selectors.EVENT_READ, (front, None))
        except BaseException:
            self._close()
            raise
        self._start_s = time.monotonic()
        if self._routes:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop; datagrams still in transit are lost."""
        self._closing.set()
        if self._routes:
            self._thread.join()
        self._close()

    @property
    def via(self) -> dict[str, str]:
        """Addresses to send to, as host:port, in place of each target."""
        listening = (UdpAddress(*front.sock.getsockname()) for front in self._fronts)
        return {str(f.route.target): str(at) for f, at in zip(self._fronts, listening, strict=True)}

    def report(self) -> TapReport:
        """Return the tap's report, with what became of each direction's datagrams."""
        with self._lock:
            report = self._tap.report(time.monotonic() - self._start_s)
            return replace(report, fates=self._fates())

    @contextlib.contextmanager
    def counting(self) -> Iterator[Tap]:
        """Lend the tap, which counts nothing while the context lasts; so keep it short."""
        with self._lock:
            yield self._tap

    def _fates(self) -> tuple[OutcomeReport, ...]:
        fates: dict[tuple[str, str], Counter[str]] = {}
        for way in (way for front in self._fronts for way in (front.to, front.back)):
            fate = fates.setdefault((way.link, way.direction), Counter())
            fate["undeliverable"] += way.undeliverable
            if way.impairer is not None:
                fate.update(vars(way.impairer.fate), delivered=way.impairer.fate.delivered)
        return tuple(OutcomeReport(*key, dict(fate)) for key, fate in sorted(fates.items()))

    def _run(self) -> None:
        while not self._closing.is_set():
            wait_s = _LOOK_S
            if self._queue:
                wait_s = min(max(self._queue[0][0] - time.monotonic(), 0.0), _LOOK_S)
            for key, _ in self._selector.select(wait_s):
                front, peer = key.data
                if peer is None:
                    self._hear_peer(front)
                else:
                    self._hear_target(front, peer)
            now = time.monotonic()
            while self._queue and self._queue[0][0] <= now:
                _, _, way, sock, address, datagram = heapq.heappop(self._queue)
                _deliver(way, sock, address, datagram)

    def _hear_peer(self, front: _Front) -> None:
        try:
            datagram, peer = front.sock.recvfrom(_LONGEST_DATAGRAM)
        except OSError:
            return
        behind = self._in_place_of.get(peer)
        if behind is not None:
            self._pass_on(front.to, behind.sock, front.target, datagram)
            return
        upstream = front.peers.pop(peer, None) or self._new_peer(front, peer)
        front.peers[peer] = upstream
        self._pass_on(front.to, upstream, None, datagram)

    def _hear_target(self, front: _Front, peer: tuple[str, int]) -> None:
        try:
            datagram = front.peers[peer].recv(_LONGEST_DATAGRAM)
        except (OSError, KeyError):  # refused: the fixed end is not there
            return
        self._pass_on(front.back, front.sock, peer, datagram)

    def _new_peer(self, front: _Front, peer: tuple[str, int]) -> socket.socket:
        if len(front.peers) >= _MAX_PEERS:
            forgotten = front.peers.pop(next(iter(front.peers)))
            self._selector.unregister(forgotten)
            forgotten.close()
        upstream = connect_udp(UdpAddress(*front.target))
        upstream.setblocking(False)
        self._selector.register(upstream, selectors.EVENT_READ, (front, peer))
        return upstream

    def _pass_on(
        self, way: _Way, sock: socket.socket, address: tuple[str, int] | None, datagram: bytes
    ) -> None:
        if self._gate is not None and not self._gate(way.link, way.direction, datagram):
            return
        now = time.monotonic()
        with self._lock:
            self._tap.count(now - self._start_s, way.link, way.direction, datagram)
            arrivals = [(now, datagram)]
            if way.impairer is not None:
                arrivals = way.impairer.send(datagram, now, self._schedule_s(now))
        for due_s, arriving in arrivals:
            if due_s <= now and not self._queue:
                _deliver(way, sock, address, arriving)
            else:
                entry = (due_s, next(self._order), way, sock, address, arriving)
                heapq.heappush(self._queue, entry)

    def _schedule_s(self, now: float) -> float:
        if not self._simulated:
            return now - self._start_s
        return -1.0 if self._tap.simulated_s is None else self._tap.simulated_s

    def _close(self) -> None:
        for front in self._fronts:
            for sock in (front.sock, *front.peers.values()):
                sock.close()
        self._selector.close()


def _deliver(
    way: _Way, sock: socket.socket, address: tuple[str, int] | None, datagram: bytes
) -> None:
    for _ in range(2):  # an error may be about the datagram before
        try:
            if address is None:
                sock.send(datagram)
            else:
                sock.sendto(datagram, address)
            return
        except OSError:
            continue
    way.undeliverable += 1

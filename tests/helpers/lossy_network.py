"""A seeded in-memory network that loses, delays, duplicates and reorders packets.

Machines are joined by real bytes: every message is packed and parsed by pymavlink's MAVLink.
Every packet goes to every other node, as on a shared UDP port. Time is simulated.
"""

import functools
import heapq
import itertools
from collections.abc import Callable
from random import Random
from typing import Any, TypeVar

from mavlink_defs.dialect import MAVLink, MAVLink_message
from mavlink_defs.services.machine import Machine, SystemId

GCS = SystemId(255, 190)
OTHER_GCS = SystemId(254, 190)
VEHICLE = SystemId(1, 1)
OTHER_VEHICLE = SystemId(2, 1)

M = TypeVar("M", bound=MAVLink_message)


def over_the_wire(message: MAVLink_message, source: SystemId, seq: int = 0) -> MAVLink_message:
    """Return `message` as a receiver gets it from `source`, without a network."""
    mav = MAVLink(None, *source)
    mav.seq = seq
    received = MAVLink(None).parse_buffer(message.pack(mav))
    assert received is not None
    return received[0]


def sent_by(machine: Machine[Any], kind: type[M]) -> list[M]:
    """Return the messages that a machine has to send; all are of this type."""
    messages = machine.messages_to_send()
    found = [message for message in messages if isinstance(message, kind)]
    assert len(found) == len(messages), messages
    return found


class Node:
    """A machine on the network; `on_event(event, now)` is its executor."""

    def __init__(self, network: "LossyNetwork", machine: Machine[Any], address: SystemId) -> None:
        self.machine, self.address = machine, address
        self.events: list[Any] = []
        self.sent: list[MAVLink_message] = []
        self.on_event: Callable[[Any, float], None] = lambda event, now: None
        self._network = network
        self._sender = MAVLink(self, *address)
        self._parser = MAVLink(None)

    def write(self, packet: bytes) -> None:
        self._network.transmit(self, packet)

    def take(self, packet: bytes, now: float) -> None:
        for message in self._parser.parse_buffer(packet) or []:
            self.machine.receive(message, now)

    def pump(self, now: float) -> None:
        for event in self.machine.events():
            self.events.append(event)
            self.on_event(event, now)
        for message in self.machine.messages_to_send():
            self.sent.append(message)
            self._sender.send(message)


class LossyNetwork:
    """Runs its nodes until nothing is left to happen."""

    def __init__(
        self, seed: int = 0, loss: float = 0.0, duplication: float = 0.0, delay_s: float = 0.01
    ) -> None:
        self.now = 0.0
        self._random = Random(seed)
        self.loss, self._duplication, self._delay_s = loss, duplication, delay_s
        self._nodes: list[Node] = []
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()

    def join(self, machine: Machine[Any], address: SystemId) -> Node:
        node = Node(self, machine, address)
        self._nodes.append(node)
        return node

    def call_at(self, time: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), action))

    def transmit(self, source: Node, packet: bytes) -> None:
        for node in self._nodes:
            if node is source:
                continue
            copies = 2 if self._random.random() < self._duplication else 1
            for _ in range(copies):
                if self._random.random() >= self.loss:
                    at = self.now + self._random.uniform(0.0, self._delay_s)
                    self.call_at(at, functools.partial(self._deliver, node, packet))

    def _deliver(self, node: Node, packet: bytes) -> None:
        node.take(packet, self.now)

    def run(self, limit_s: float) -> None:
        """Run until all is quiet; a machine that still waits at `limit_s` hangs."""
        while (now := self._next_time()) is not None:
            assert now <= limit_s, f"still waiting after {limit_s} s"
            self.now = max(self.now, now)
            while self._agenda and self._agenda[0][0] <= self.now:
                heapq.heappop(self._agenda)[2]()
                self._pump()
            for node in self._nodes:
                node.machine.handle_timer(self.now)
            self._pump()

    def _next_time(self) -> float | None:
        self._pump()
        deadlines = [node.machine.deadline() for node in self._nodes]
        times = [time for time in deadlines if time is not None]
        if self._agenda:
            times.append(self._agenda[0][0])
        return min(times, default=None)

    def _pump(self) -> None:
        for node in self._nodes:
            node.pump(self.now)

"""Two ground stations and short-lived clients command a vehicle over a network that misbehaves."""

import math
from collections import deque
from dataclasses import dataclass, field

from command_messages import (
    ACCEPTED,
    ARM,
    QUESTIONS,
    SET_FAULT,
    int_,
    long,
)
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, OTHER_GCS, VEHICLE, LossyNetwork

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.command import CommandClient, CommandFinished, CommandProgress
from mavlink_defs.services.command_server import LATE_S, CommandReceived, CommandServer
from mavlink_defs.services.machine import Machine, SystemId


class Registers(Machine[None]):
    """A vehicle whose commands set things; faults take a while, one after the other."""

    def __init__(self, work_s: float) -> None:
        super().__init__()
        self.held: dict[int, float] = {}
        self.asked: list[float] = []
        self._server = CommandServer(VEHICLE)
        self._work_s = work_s
        self._working: deque[tuple[float, CommandReceived]] = deque()

    def receive(self, message: MAVLink_message, now: float) -> None:
        self._server.receive(message, now)
        for event in self._server.events():
            if event.message.command in QUESTIONS:
                self.asked.append(now)
            if event.message.command == SET_FAULT:
                self._working.append((now + self._work_s, event))
            else:
                self._execute(event, now)
        self._outbox += self._server.messages_to_send()

    def handle_timer(self, now: float) -> None:
        while self._working and self._working[0][0] <= now:
            self._execute(self._working.popleft()[1], now)
        self._outbox += self._server.messages_to_send()

    def deadline(self) -> float | None:
        return self._working[0][0] if self._working else None

    def _execute(self, event: CommandReceived, now: float) -> None:
        self.held[event.message.command] = event.message.param1
        self._server.finish(event.token, ACCEPTED, now=now)


@dataclass
class Order:
    """A command that a station gives; a short-lived client has a socket of its own for it."""

    form: type
    command: int
    value: float
    is_short_lived: bool
    begin: float = math.inf
    end: float = math.inf
    result: int | None = None


@dataclass
class Station:
    """Gives one order after the other."""

    network: LossyNetwork
    address: SystemId
    orders: list[Order]
    given: int = 0
    client: CommandClient = field(init=False)

    def __post_init__(self) -> None:
        self._open()
        self.network.call_at(0.0, self._give)

    def _open(self) -> None:
        self.client = CommandClient(self.address)
        self.network.join(self.client, self.address).on_event = self._finish

    def _give(self) -> None:
        if self.given < len(self.orders):
            order = self.orders[self.given]
            order.begin = self.network.now
            self.client.send(order.form(order.value, order.command), self.network.now)

    def _finish(self, event: CommandFinished | CommandProgress, now: float) -> None:
        if isinstance(event, CommandFinished):
            order = self.orders[self.given]
            order.end, order.result = now, event.result
            self.given += 1
            pause_s = 0.0
            if self.given < len(self.orders) and self.orders[self.given].is_short_lived:
                self._open()
                pause_s = 2.5 * LATE_S  # a process takes that to start
            self.network.call_at(now + pause_s, self._give)


ORDERS = st.lists(
    st.builds(
        Order,
        form=st.sampled_from([long, long, int_]),
        command=st.sampled_from([ARM, ARM, SET_FAULT, dialect.MAV_CMD_REQUEST_MESSAGE]),
        value=st.sampled_from([0.0, 1.0]),
        is_short_lived=st.booleans(),
    ),
    max_size=8,
)


@given(
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.4),
    duplication=st.floats(0.0, 0.5),
    delay_s=st.floats(0.001, LATE_S),
    work_s=st.sampled_from([0.0, 0.03, 0.3]),
    orders=st.tuples(ORDERS, ORDERS),
)
def test_what_was_accepted_holds(
    seed: int,
    loss: float,
    duplication: float,
    delay_s: float,
    work_s: float,
    orders: tuple[list[Order], list[Order]],
) -> None:
    """Accepted commands take effect in their order, each between begin and end."""
    network = LossyNetwork(seed, loss, duplication, delay_s)
    vehicle = Registers(work_s)
    network.join(vehicle, VEHICLE)
    for address, its_orders in zip((GCS, OTHER_GCS), orders, strict=True):
        Station(network, address, its_orders)
    network.run(limit_s=200.0)

    for command in (ARM, SET_FAULT):
        ours = [order for both in orders for order in both if order.command == command]
        accepted = [order for order in ours if order.result == ACCEPTED]
        last = max((order.begin for order in accepted), default=-1.0)
        possible = {order.value for order in ours if order.end > last}
        if not accepted:
            possible.add(math.nan)
        assert vehicle.held.get(command, math.nan) in possible, ours
    for order in (order for both in orders for order in both if order.result == ACCEPTED):
        if order.command in QUESTIONS:
            assert any(order.begin <= at <= order.end for at in vehicle.asked)

"""Runs the microservice machines of a client in its event loop."""

import asyncio
import math
from collections import defaultdict
from collections.abc import Callable
from typing import Any, TypeVar

from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.machine import Machine

E = TypeVar("E")  # events of a machine
F = TypeVar("F")  # the last one


class MachineRunner:
    """Sends the messages of machines, delivers their events, calls them at their deadlines.

    Attributes:
        now: The clock [s].
    """

    def __init__(self, now: Callable[[], float], send: Callable[[MAVLink_message], None]) -> None:
        """Prepare a runner.

        Args:
            now: Returns the time [s].
            send: Sends a message to the vehicle that it is addressed to.
        """
        self.now = now
        self._send = send
        self._machines: dict[Machine[Any], Callable[[Any], None]] = {}
        self._turns: defaultdict[tuple[int, str], asyncio.Lock] = defaultdict(asyncio.Lock)
        self._timer: asyncio.TimerHandle | None = None

    async def run(
        self,
        turn: tuple[int, str],
        machine: Machine[E],
        start: Callable[[float], None],
        finished: type[F],
        on_event: Callable[[E], None] | None = None,
        stop: Callable[[float], None] | None = None,
    ) -> F:
        """Start a machine when its turn comes and run it until an event of type `finished`.

        Args:
            turn: System and service: machines of the same one wait for each other, because
                answers do not say which request they belong to.
            machine: The machine.
            start: Called with the time to start it.
            finished: Type of its last event, which is returned.
            on_event: Called with its other events.
            stop: Called with the time if this coroutine is cancelled.
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
                    self._pump()  # send the machine's last messages
                del self._machines[machine]

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Pass a message to all machines."""
        for machine in list(self._machines):
            machine.receive(message, now)
        if self._machines:
            self._pump()

    def close(self) -> None:
        """Cancel the timer."""
        if self._timer is not None:
            self._timer.cancel()

    def _pump(self) -> None:
        """Send the machines' messages, deliver their events, set the timer."""
        deadline = math.inf
        for machine, deliver in list(self._machines.items()):
            for message in machine.messages_to_send():
                self._send(message)
            for event in machine.events():
                deliver(event)
            deadline = min(deadline, machine.deadline() or math.inf)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if deadline < math.inf:
            loop = asyncio.get_running_loop()
            delay_s = max(deadline - self.now(), 0.0)
            self._timer = loop.call_later(delay_s, self._handle_timer)

    def _handle_timer(self) -> None:
        now = self.now()
        for machine in list(self._machines):
            machine.handle_timer(now)
        self._pump()

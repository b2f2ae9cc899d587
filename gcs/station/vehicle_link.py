"""The link to one vehicle: what is known of it, and machines that run until they or it give up."""

import copy
from collections.abc import Callable, Iterable
from typing import Self, TypeVar

from gcs.console.errors import CommandRefused, NoAnswer
from gcs.station.machine_runner import MachineRunner
from gcs.station.notifications import ERROR, WARNING, Notification, enum_name
from gcs.station.patience import USUAL, Patience
from gcs.station.subscriptions import Feed
from gcs.station.vehicle_state import LOST_S, VehicleState
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.command import CommandClient
from mavlink_defs.services.machine import Machine, SystemId
from mavlink_defs.services.mission import MissionProgress
from mavlink_defs.services.param import ParamProgress

Progress = Callable[[int, int], None]
"""Called with the number of items done and the total."""

E = TypeVar("E")  # events of a machine
F = TypeVar("F")  # the last one


class VehicleLink:
    """What the operations of a `gcs.station.vehicle.Vehicle` stand on.

    Attributes:
        id: Its system id; `system` is the same.
        state: What is known of it: mode, arming, latest messages, event counts, faults, mission.
        patience: How long operations wait for its answers.
    """

    def __init__(
        self,
        own: SystemId,
        state: VehicleState,
        machines: MachineRunner,
        emit: Callable[[Iterable[Notification]], None],
        received: Feed[MAVLink_message],
        patience: Patience = USUAL,
    ) -> None:
        """Prepare the operations on a vehicle.

        Args:
            own: System and component id of the ground station.
            state: The vehicle's known state.
            machines: Runs the operations.
            emit: Called with the notifications of operations.
            received: The messages of all vehicles.
            patience: How long operations wait for answers.
        """
        self.patience = patience
        self.id = self.system = state.system
        self.state = state
        self._machines, self._emit, self._received = machines, emit, received
        self._own, self._address = own, state.address
        self._commands = CommandClient(own)

    def with_patience(self, patience: Patience) -> Self:
        """Return the same vehicle, whose operations wait so long for answers."""
        same = copy.copy(self)
        same.patience = patience
        return same

    @property
    def is_heard(self) -> bool:
        """Whether it was heard so lately that it is waited for."""
        return self.state.age_s(self._now()) < self.patience.silence_s

    @property
    def last_heard(self) -> str:
        """How long it has been silent, or that it still sends, at the end of a message."""
        silent_s = self.state.age_s(self._now())
        return f": silent for {silent_s:.1f} s" if silent_s >= LOST_S else ", though it still sends"

    def _now(self) -> float:
        return self._machines.now()

    async def _run(
        self,
        service: str,
        machine: Machine[E],
        start: Callable[[float], None],
        finished: type[F],
        progress: Progress | None = None,
        stop: Callable[[float], None] | None = None,
    ) -> tuple[F, list[str]]:
        """Run a machine; return its last event and the vehicle's warnings meanwhile."""
        heard, answered_s = 0, 0.0

        def begin(now: float) -> None:
            nonlocal heard, answered_s
            heard, answered_s = self.state.texts_heard, now
            start(now)

        def is_worth_waiting(now: float) -> bool:
            return self.patience.lasts(self.state.age_s(now), now - answered_s)

        def on_event(event: E) -> None:
            nonlocal answered_s
            answered_s = self._now()
            if progress is not None and isinstance(event, MissionProgress | ParamProgress):
                progress(event.done, event.total)

        machine.wait_while(is_worth_waiting)
        turn = (self.system, service)
        done = await self._machines.run(turn, machine, begin, finished, on_event, stop)
        texts = self.state.texts_since(heard)
        return done, [text.text for text in texts if text.severity <= WARNING]

    def _judge(self, what: str, result: int | None, ok: int, enum: str, reasons: list[str]) -> None:
        """Raise the error that belongs to a result other than `ok`."""
        if result == ok:
            return
        if result is None:
            raise self._no_answer(f"UAV {self.system} did not answer {what}{self.last_heard}")
        answer, reason = enum_name(enum, result), "".join(f": {text}" for text in reasons)
        raise CommandRefused(f"UAV {self.system} refused {what} ({answer}){reason}", result)

    def _no_answer(self, text: str) -> NoAnswer:
        self._emit([Notification(self._now(), self.system, "ack", ERROR, text)])
        return NoAnswer(text)

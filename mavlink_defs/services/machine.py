"""The base class of all microservice machines.

A machine has no socket and no clock: messages and `now` go in; messages, events and the next
deadline come out. After every call of any method, send `messages_to_send()`, read `events()`,
then arm a timer at `deadline()` and call `handle_timer()` when it fires. The clock may be any
that does not go backwards.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from mavlink_defs.dialect import MAVLink_message

E = TypeVar("E")

SLOW_S = 2.0
"""Least period of requests to a vehicle that lives and does not answer [s]."""


class SystemId(NamedTuple):
    """System and component of one end of a conversation."""

    system: int
    component: int


def sender_of(message: MAVLink_message) -> SystemId:
    """Return the address that `message` came from."""
    return SystemId(message.get_srcSystem(), message.get_srcComponent())


def is_for(message: MAVLink_message, own: SystemId) -> bool:
    """Return whether a message is addressed to `own`, by name or as a broadcast (0)."""
    return getattr(message, "target_system", 0) in {0, own.system} and getattr(
        message, "target_component", 0
    ) in {0, own.component}


def sent_before(message: MAVLink_message, other: MAVLink_message) -> bool:
    """Return whether a message was sent before another one, by their sequence numbers."""
    return bool((other.get_seq() - message.get_seq()) % 256 < 128)


class Machine(ABC, Generic[E]):
    """One side of a microservice; `E` is the type of its events."""

    def __init__(self) -> None:
        self._outbox: list[MAVLink_message] = []
        self._happened: list[E] = []
        self._is_worth_waiting: Callable[[float], bool] = lambda _: False

    def wait_while(self, is_worth_waiting: Callable[[float], bool]) -> None:
        """Repeat an unanswered request more often than usual while this holds, given the time.

        A vehicle on a busy machine answers late: whoever hears that it lives can wait.
        """
        self._is_worth_waiting = is_worth_waiting

    @abstractmethod
    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in any received message; others are ignored."""

    @abstractmethod
    def handle_timer(self, now: float) -> None:
        """Do what is due at `now` [s]; harmless when nothing is."""

    @abstractmethod
    def deadline(self) -> float | None:
        """Return the time of the next `handle_timer()` [s]; None when nothing is awaited."""

    def messages_to_send(self) -> list[MAVLink_message]:
        """Hand over the messages to send, in order, once."""
        messages, self._outbox = self._outbox, []
        return messages

    def events(self) -> list[E]:
        """Hand over what has happened, in order, once."""
        happened, self._happened = self._happened, []
        return happened

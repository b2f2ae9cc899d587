"""How a message of the telemetry is declared: at the method that makes it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Declared:
    """What is declared of a message.

    Attributes:
        number: Its message id.
        every_us: Interval at which it is streamed from the start [µs]; None: on request only.
        stream: MAV_DATA_STREAM with which a REQUEST_DATA_STREAM asks for it; None: none.
        maker: Name of the method that makes it.
    """

    number: int
    every_us: int | None
    stream: int | None
    maker: str


def message(
    kind: Any, *, every_s: float | None = None, stream: int | None = None
) -> Callable[[_F], _F]:
    """Declare that a method makes a message, which can be streamed and requested from then on.

    Args:
        kind: Class of the message in the dialect.
        every_s: Interval at which it is streamed from the start [s], of common.xml only: a station
            without our dialect counts others as lost. None: on request only.
        stream: MAV_DATA_STREAM, as ArduPlane groups its messages.
    """

    def declare(maker: _F) -> _F:
        every_us = None if every_s is None else round(every_s * 1e6)
        vars(maker)["declared"] = Declared(kind.id, every_us, stream, maker.__name__)
        return maker

    return declare


def declared_in(*classes: type) -> Iterator[Declared]:
    """Yield the messages that methods of classes make, in the order of their definition."""
    for makers in classes:
        for name in vars(makers):
            found = getattr(getattr(makers, name), "declared", None)
            if found is not None:
                yield found

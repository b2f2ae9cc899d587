"""A bad link: loss, bursts, delay, jitter, reordering, duplication, bit errors, outages.

`Impairment` configures what a link does to datagrams, `Impairer` applies it: a machine without
socket and clock. The same datagrams at the same times always fare the same. What happens to a
datagram depends on the seed, its content, and how often this content came before, but not on
its sequence number, nor on what else was sent. So a lockstep flight, whose number of datagrams
before the start depends on the wall clock, loses the same control messages in every run. Only
bursts go by the order of datagrams, and jitter by the times between them.
"""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from mavlink_defs.capture.impairing import COPIES, new_directions, put
from mavlink_defs.config.models import AtMost, Model, Problems
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.constants import MAX_DATAGRAM

Share = Annotated[float, quantity("", ge=0.0, le=1.0, doc="Share of the datagrams.")]


class Bursts(Model):
    """Gilbert-Elliott: the link changes between good and bad; `loss` of the link holds in good."""

    begin: Share = Field(description="Probability that a datagram finds a burst begun.")
    end: float = quantity("", gt=0.0, le=1.0, doc="Probability that it finds a burst ended.")
    loss: float = quantity("", ge=0.0, le=1.0, default=1.0, doc="Loss within a burst.")


class Outage(Model):
    """A time during which nothing passes."""

    from_s: float = quantity("s", ge=0.0, doc="Begin, inclusive.")
    to_s: float = quantity("s", gt=0.0, doc="End, exclusive.")

    @model_validator(mode="after")
    def _in_order(self) -> "Outage":
        if self.to_s <= self.from_s:
            text = f"expected > from_s = {self.from_s!r} s, got {self.to_s!r}"
            raise Problems([(("to_s",), text)])
        return self


class Impairment(Model):
    """Impairments of each datagram on a link, in either direction; none by default."""

    seed: int = whole("", ge=0, le=2**63 - 1, default=1, doc="Seed of the random choices.")
    loss: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that is lost.")
    bursts: Bursts | None = Field(default=None, description="Losses in bursts; none: no bursts.")
    duplicate: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that comes twice.")
    delay_ms: float = quantity(
        "ms", ge=0.0, le=60_000.0, default=0.0, doc="Delay of every datagram."
    )
    jitter_ms: float = quantity(
        "ms",
        ge=0.0,
        le=60_000.0,
        default=0.0,
        doc="Largest random addition to the delay; order is kept.",
    )
    reorder: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that is overtaken.")
    reorder_ms: float = quantity(
        "ms",
        gt=0.0,
        le=60_000.0,
        default=10.0,
        doc="Time by which overtaken datagrams are held back.",
    )
    bit_errors: float = quantity(
        "", ge=0.0, le=0.5, default=0.0, doc="Share of the bits that are inverted."
    )
    outages: Annotated[tuple[Outage, ...], AtMost(1000)] = Field(
        default=(), description="Times during which every datagram is lost [s]."
    )

    @property
    def is_identity(self) -> bool:
        """Whether every datagram arrives at once, as it is."""
        shares = (self.loss, self.duplicate, self.reorder, self.bit_errors)
        return not (any(shares) or self.delay_ms or self.jitter_ms or self.bursts or self.outages)


@dataclass
class Fate:
    """Outcome counts of the datagrams of one direction."""

    taken: int = 0
    outage: int = 0
    lost: int = 0
    duplicated: int = 0
    reordered: int = 0
    damaged: int = 0

    @property
    def delivered(self) -> int:
        """Datagrams delivered; each duplicate counts."""
        return self.taken - self.outage - self.lost + self.duplicated

    @classmethod
    def of(cls, counts: np.ndarray) -> Self:
        """Return the counts in an array of the order of `FATES`."""
        return cls(*map(int, counts))


class Impairer:
    """One direction of a link.

    Args:
        impairment: Impairment of the link.
        path: Name of the direction. Two paths with one seed do not lose the same datagrams.
    """

    def __init__(self, impairment: Impairment, path: str) -> None:
        self._directions = new_directions([(impairment, path)])
        self._due_s = np.zeros(COPIES)
        self._data = np.zeros(MAX_DATAGRAM, np.uint8)
        self._copies = np.zeros((COPIES, MAX_DATAGRAM), np.uint8)

    @property
    def fate(self) -> Fate:
        """What became of the datagrams so far."""
        return Fate.of(self._directions.fates[0])

    def send(
        self, datagram: bytes, now_s: float, schedule_s: float | None = None
    ) -> list[tuple[float, bytes]]:
        """Put a datagram on the link.

        Args:
            datagram: Its UDP payload.
            now_s: The time, which does not go backwards [s].
            schedule_s: The time that outages count, if another [s].

        Returns:
            Times of arrival at the other end [s], and datagrams: none, one or two.
        """
        length, at_s = len(datagram), now_s if schedule_s is None else schedule_s
        self._data[:length] = np.frombuffer(datagram, np.uint8)
        arrivals = put(
            self._directions,
            0,
            self._data,
            length,
            float(now_s),
            float(at_s),
            self._due_s,
            self._copies,
        )
        return [
            (float(self._due_s[k]), self._copies[k, :length].tobytes()) for k in range(arrivals)
        ]

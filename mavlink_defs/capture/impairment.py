"""A bad link: loss, bursts, delay, jitter, reordering, duplication, bit errors, outages.

`Impairment` configures what a link does to datagrams, `Impairer` applies it: a machine without
socket and clock. The same datagrams at the same times always fare the same. What happens to a
datagram depends on the seed, its content, and how often this content came before, but not on
its sequence number, nor on what else was sent. So a lockstep flight, whose number of datagrams
before the start depends on the wall clock, loses the same control messages in every run. Only
bursts go by the order of datagrams, and jitter by the times between them.
"""

import math
from dataclasses import dataclass
from hashlib import blake2b
from random import Random
from typing import Annotated

from pydantic import Field, model_validator

from mavlink_defs import dialect
from mavlink_defs.config.models import Model, Problems
from mavlink_defs.config.quantity import quantity, whole

__all__ = ["Bursts", "Fate", "Impairer", "Impairment", "Outage"]

_MEMORY = 4096  # contents that are remembered, to recognise repetitions

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
    outages: tuple[Outage, ...] = Field(
        default=(), description="Times during which every datagram is lost [s]."
    )


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


class Impairer:
    """One direction of a link.

    Args:
        impairment: Impairment of the link.
        path: Name of the direction. Two paths with one seed do not lose the same datagrams.
    """

    def __init__(self, impairment: Impairment, path: str) -> None:
        self.fate = Fate()
        self._impairment = impairment
        self._key = blake2b(f"{impairment.seed}/{path}".encode(), digest_size=32).digest()
        self._random = Random()
        self._seen: dict[int, int] = {}
        self._in_burst = False
        self._newest_s = -math.inf

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
        impairment, fate, random = self._impairment, self.fate, self._random
        fate.taken += 1
        random.seed(self._number(datagram))
        lost = self._is_lost(random)
        twice = random.random() < impairment.duplicate
        at_s = now_s if schedule_s is None else schedule_s
        if any(outage.from_s <= at_s < outage.to_s for outage in impairment.outages):
            fate.outage += 1
            return []
        if lost:
            fate.lost += 1
            return []
        fate.duplicated += twice
        return [self._arrival(datagram, now_s, random) for _ in range(1 + twice)]

    def _is_lost(self, random: Random) -> bool:
        change, loss = random.random(), random.random()
        bursts = self._impairment.bursts
        if bursts is not None:
            self._in_burst = change >= bursts.end if self._in_burst else change < bursts.begin
            if self._in_burst:
                return loss < bursts.loss
        return loss < self._impairment.loss

    def _arrival(self, datagram: bytes, now_s: float, random: Random) -> tuple[float, bytes]:
        impairment = self._impairment
        overtaken = random.random() < impairment.reorder
        due_s = now_s + (impairment.delay_ms + impairment.jitter_ms * random.random()) / 1e3
        if overtaken:
            self.fate.reordered += 1
            due_s += impairment.reorder_ms / 1e3
        else:
            due_s = self._newest_s = max(due_s, self._newest_s)
        return due_s, self._damaged(datagram, random)

    def _damaged(self, datagram: bytes, random: Random) -> bytes:
        share = self._impairment.bit_errors
        if share == 0.0:
            return datagram
        bits = bytearray(datagram)
        i = _gap(share, random)
        while i < 8 * len(bits):
            bits[i // 8] ^= 1 << i % 8
            i += 1 + _gap(share, random)
        self.fate.damaged += bits != datagram
        return bytes(bits)

    def _number(self, datagram: bytes) -> int:
        """Return a number derived from the content and from how often it has come."""
        content = datagram
        if len(datagram) > dialect.HEADER_LEN_V2 and datagram[0] == dialect.PROTOCOL_MARKER_V2:
            content = datagram[5 : dialect.HEADER_LEN_V2 + datagram[1]]  # from the system id on
        number = int.from_bytes(blake2b(content, key=self._key, digest_size=8).digest())
        if len(self._seen) >= _MEMORY:
            self._seen.clear()
        times = self._seen[number] = self._seen.get(number, -1) + 1
        return number + times


def _gap(share: float, random: Random) -> int:
    """Return the number of good bits before the next bad one."""
    return int(min(math.log(1.0 - random.random()) / math.log1p(-share), 1e9))

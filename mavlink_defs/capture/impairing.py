"""What becomes of each datagram on a bad link, in compiled code without socket and clock.

The same datagrams at the same times always fare the same. What happens to a
datagram depends on the seed, its content, and how often this content came before, but not on
its sequence number, nor on what else was sent. So a lockstep flight, whose number of datagrams
before the start depends on the wall clock, loses the same control messages in every run. Only
bursts go by the order of datagrams, and jitter by the times between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from typing import NamedTuple, Self

import numpy as np

from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.framing.header import HEADER_SIZE, MAGIC, PAYLOAD_SIZE, SYSTEM, V2_MAGIC
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_bytes, slot_of
from mavlink_defs.runtime.random_numbers import GENERATOR_SIZE, keyed_hash, seed_generator, uniform

COPIES = 2
"""The most that arrives of one datagram."""

FATES = ("taken", "outage", "lost", "duplicated", "reordered", "damaged")
_TAKEN, _OUTAGE, _LOST, _DUPLICATED, _REORDERED, _DAMAGED = range(len(FATES))

MEMORY = 4096
"""Contents that are remembered, to recognise repetitions."""

_FARTHEST = 1e9  # bits

SETTINGS = np.dtype(
    [
        ("identity", "i8"),  # 1: every datagram arrives at once, as it is
        ("loss", "f8"),
        ("has_bursts", "i8"),
        ("begin", "f8"),
        ("end", "f8"),
        ("burst_loss", "f8"),
        ("duplicate", "f8"),
        ("delay_ms", "f8"),
        ("jitter_ms", "f8"),
        ("reorder", "f8"),
        ("reorder_ms", "f8"),
        ("bit_errors", "f8"),
        ("in_burst", "i8"),
        ("newest_s", "f8"),  # latest arrival of what was not overtaken [s]
        ("contents", "i8"),  # contents that are remembered
    ]
)


class Directions(NamedTuple):
    """Impairment and state of n directions of links."""

    settings: np.ndarray  # (n,), dtype SETTINGS
    outages: np.ndarray  # (n, most, 2), begin and end [s]
    keys: np.ndarray  # (n, 2), of the hash
    contents: np.ndarray  # (n, 2 * MEMORY), hashes of the contents that came, of `slot_of`
    times: np.ndarray  # (n, 2 * MEMORY), how often each came
    generators: np.ndarray  # (n, GENERATOR_SIZE)
    fates: np.ndarray  # (n, len(FATES)), datagrams by outcome


def new_directions(links: Sequence[tuple[Impairment, str]]) -> Directions:
    """Return directions on which nothing was sent.

    Args:
        links: Impairment and path of each, as of `Impairer`.
    """
    n = len(links)
    settings = np.zeros(n, SETTINGS)
    most = max((len(impairment.outages) for impairment, _ in links), default=0)
    outages = np.full((n, most, 2), np.inf)
    keys = np.zeros((n, 2), np.int64)
    for i, (impairment, path) in enumerate(links):
        digest = blake2b(f"{impairment.seed}/{path}".encode(), digest_size=8).digest()
        keys[i] = np.frombuffer(digest, "<u4")
        for name in ("loss", "duplicate", "delay_ms", "jitter_ms", "reorder", "reorder_ms"):
            settings[i][name] = getattr(impairment, name)
        settings[i]["bit_errors"] = impairment.bit_errors
        settings[i]["identity"] = impairment.is_identity
        settings[i]["newest_s"] = -np.inf
        if (bursts := impairment.bursts) is not None:
            settings[i]["has_bursts"] = 1
            settings[i]["begin"], settings[i]["end"] = bursts.begin, bursts.end
            settings[i]["burst_loss"] = bursts.loss
        for k, outage in enumerate(impairment.outages):
            outages[i, k] = outage.from_s, outage.to_s
    return Directions(
        settings=settings,
        outages=outages,
        keys=keys,
        contents=np.zeros((n, 2 * MEMORY), np.int64),
        times=np.zeros((n, 2 * MEMORY), np.int64),
        generators=np.zeros((n, GENERATOR_SIZE), np.int64),
        fates=np.zeros((n, len(FATES)), np.int64),
    )


@compiled
def put(
    directions: Directions,
    i: int,
    data: np.ndarray,
    length: int,
    now_s: float,
    schedule_s: float,
    due_s: np.ndarray,
    copies: np.ndarray,
) -> int:
    """Put a datagram on a link.

    Args:
        directions: All directions.
        i: Which one.
        data: The UDP payload, uint8.
        length: Its length [bytes].
        now_s: The time, which does not go backwards [s].
        schedule_s: The time that outages count [s].
        due_s: Times of arrival at the other end [s], shape (COPIES,), written.
        copies: What arrives, uint8, shape (COPIES, longest), written.

    Returns:
        How many copies arrive: 0 to COPIES.
    """
    settings, fates = directions.settings[i], directions.fates[i]
    generator = directions.generators[i]
    fates[_TAKEN] += 1
    if settings["identity"] != 0:
        due_s[0] = now_s
        copy_bytes(copies[0], 0, data, 0, length)
        return 1
    _seed(directions, i, data, length)
    lost = _is_lost(settings, generator)
    twice = uniform(generator) < settings["duplicate"]
    for k in range(directions.outages.shape[1]):
        if directions.outages[i, k, 0] <= schedule_s < directions.outages[i, k, 1]:
            fates[_OUTAGE] += 1
            return 0
    if lost:
        fates[_LOST] += 1
        return 0
    number = 2 if twice else 1
    fates[_DUPLICATED] += number - 1
    for k in range(number):
        due_s[k] = _arrival_s(settings, generator, fates, now_s)
        copy_bytes(copies[k], 0, data, 0, length)
        if settings["bit_errors"] > 0.0 and _damage(
            copies[k], length, settings["bit_errors"], generator
        ):
            fates[_DAMAGED] += 1
    return number


@compiled
def _seed(directions: Directions, i: int, data: np.ndarray, length: int) -> None:
    """Begin the random numbers of a content and of how often it has come."""
    begin, end = 0, length
    if length > HEADER_SIZE and data[MAGIC] == V2_MAGIC:
        begin = SYSTEM  # what comes before is the sequence number, and no content
        end = min(length, HEADER_SIZE + int(np.int64(data[PAYLOAD_SIZE])))
    low, high = keyed_hash(directions.keys[i], data, begin, end)
    contents, settings = directions.contents[i], directions.settings[i]
    key = max(1, low | ((high & 0x7FFFFFFF) << 32))
    if settings["contents"] >= MEMORY:
        for k in range(contents.size):
            contents[k] = 0
        settings["contents"] = 0
    slot = slot_of(contents, key)
    if contents[slot] == 0:
        contents[slot] = key
        directions.times[i, slot] = 0
        settings["contents"] += 1
    else:
        directions.times[i, slot] += 1
    seed_generator(directions.generators[i], int(directions.times[i, slot]), low, high)


@compiled
def _is_lost(settings: np.void, generator: np.ndarray) -> bool:
    change, loss = uniform(generator), uniform(generator)
    if settings["has_bursts"] != 0:
        if settings["in_burst"] != 0:
            settings["in_burst"] = 1 if change >= settings["end"] else 0
        else:
            settings["in_burst"] = 1 if change < settings["begin"] else 0
        if settings["in_burst"] != 0:
            return bool(loss < settings["burst_loss"])
    return bool(loss < settings["loss"])


@compiled
def _arrival_s(settings: np.void, generator: np.ndarray, fates: np.ndarray, now_s: float) -> float:
    """Return when a copy arrives [s]."""
    overtaken = uniform(generator) < settings["reorder"]
    later_ms = settings["delay_ms"] + settings["jitter_ms"] * uniform(generator)
    due_s = now_s + later_ms / 1e3
    if overtaken:
        fates[_REORDERED] += 1
        return float(due_s + settings["reorder_ms"] / 1e3)
    settings["newest_s"] = max(due_s, settings["newest_s"])
    return float(settings["newest_s"])


@compiled
def _damage(data: np.ndarray, length: int, share: float, generator: np.ndarray) -> bool:
    """Invert a share of the bits of data[:length]; return whether any."""
    i = _gap(share, generator)
    damaged = i < 8 * length
    while i < 8 * length:
        data[i // 8] ^= 1 << i % 8
        i += 1 + _gap(share, generator)
    return damaged


@compiled
def _gap(share: float, generator: np.ndarray) -> int:
    """Return the number of good bits before the next bad one."""
    gap = np.log(1.0 - uniform(generator)) / np.log1p(-share)
    return int(min(gap, _FARTHEST))


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

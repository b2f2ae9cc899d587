"""Datagrams that are to be delivered later, for compiled code: a heap, and chunks of bytes.

Arrays do not grow by themselves: `with_room` returns larger ones with the same datagrams. The heap
is not of ``heapq``, which needs a typed list: numba compiles that again in each process.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_bytes
from mavlink_defs.runtime.native import ADDRESS_SIZE

_CHUNK = 320  # bytes: a datagram of one frame has one chunk
_ROOM = 64  # chunks at first

STATE = np.dtype([("waiting", "i8"), ("order", "i8"), ("free", "i8"), ("first_free", "i8")])
ENTRY = np.dtype(
    [
        ("due_s", "f8"),
        ("order", "i8"),
        ("way", "i8"),
        ("fd", "i8"),
        ("connected", "i8"),  # 1: the socket is connected, there is no address
        ("length", "i8"),
        ("next", "i8"),  # chunk that continues the datagram, or the next free one
    ]
)


class Destination(NamedTuple):
    """Where a datagram is to go."""

    way: int  # direction of a route that it takes
    fd: int  # socket to send it from; -1: there is none
    connected: bool  # whether the socket is connected
    address: np.ndarray  # where to send it, if not, shape (ADDRESS_SIZE,)


class Delayed(NamedTuple):
    """Datagrams by the number of their first chunk."""

    state: np.ndarray  # (1,), dtype STATE
    heap: np.ndarray  # (chunks,), numbers of datagrams, the earliest first
    entries: np.ndarray  # (chunks,), dtype ENTRY
    addresses: np.ndarray  # (chunks, ADDRESS_SIZE)
    chunks: np.ndarray  # (chunks, _CHUNK)


def new_delayed(chunks: int = _ROOM) -> Delayed:
    """Return room for some chunks of datagrams, and no datagram."""
    state = np.zeros(1, STATE)
    state["free"] = chunks
    entries = np.zeros(chunks, ENTRY)
    entries["next"] = np.arange(1, chunks + 1)
    return Delayed(
        state=state,
        heap=np.zeros(chunks, np.int64),
        entries=entries,
        addresses=np.zeros((chunks, ADDRESS_SIZE), np.uint8),
        chunks=np.zeros((chunks, _CHUNK), np.uint8),
    )


def with_room(delayed: Delayed, length: int, number: int) -> Delayed:
    """Return the same datagrams, with room for some more of some length [bytes]."""
    while not has_room(delayed, length, number):
        before, state = len(delayed.entries), delayed.state[0]
        more = new_delayed(before)
        more.entries["next"] += before
        more.entries[-1]["next"] = state["first_free"]
        state["first_free"] = before
        state["free"] += before
        pairs = zip(delayed[1:], more[1:], strict=True)
        delayed = Delayed(delayed.state, *(np.concatenate(pair) for pair in pairs))
    return delayed


@compiled
def _chunks_of(length: int) -> int:
    return max(1, (length + _CHUNK - 1) // _CHUNK)


@compiled
def has_room(delayed: Delayed, length: int, number: int) -> bool:
    """Return whether there is room for some more datagrams of some length [bytes]."""
    return bool(delayed.state[0]["free"] >= number * _chunks_of(length))


@compiled
def earliest_s(delayed: Delayed) -> float:
    """Return when the first datagram is due [s]; infinity if there is none."""
    if delayed.state[0]["waiting"] == 0:
        return np.inf
    return float(delayed.entries[delayed.heap[0]]["due_s"])


@compiled
def add(delayed: Delayed, due_s: float, to: Destination, data: np.ndarray, length: int) -> None:
    """Keep a datagram until it is due; there has to be room.

    Args:
        delayed: The others.
        due_s: When it is due [s]; of equal ones the first comes first.
        to: Where it goes.
        data: The payload, uint8.
        length: Its length [bytes].
    """
    state, chunks = delayed.state[0], _chunks_of(length)
    number = last = state["first_free"]
    for k in range(chunks):
        if k > 0:
            last = delayed.entries[last]["next"]
        begin = k * _CHUNK
        size = min(_CHUNK, length - begin)
        copy_bytes(delayed.chunks[last], 0, data, begin, size)
    state["first_free"] = delayed.entries[last]["next"]
    state["free"] -= chunks
    entry = delayed.entries[number]
    entry["due_s"], entry["order"] = due_s, state["order"]
    entry["way"], entry["fd"], entry["length"] = to.way, to.fd, length
    entry["connected"] = 1 if to.connected else 0
    copy_bytes(delayed.addresses[number], 0, to.address, 0, ADDRESS_SIZE)
    state["order"] += 1
    at = state["waiting"]
    state["waiting"] += 1
    while at > 0:
        parent = (at - 1) // 2
        if not _before(delayed, number, delayed.heap[parent]):
            break
        delayed.heap[at] = delayed.heap[parent]
        at = parent
    delayed.heap[at] = number


@compiled
def take(delayed: Delayed, data: np.ndarray) -> int:
    """Take out the first datagram; there has to be one.

    Args:
        delayed: The datagrams.
        data: Where to put the payload, uint8.

    Returns:
        Its number: its entry and address are valid until the next is added.
    """
    state, heap = delayed.state[0], delayed.heap
    number = heap[0]
    state["waiting"] -= 1
    waiting = state["waiting"]
    moved, at = heap[waiting], 0
    while 2 * at + 1 < waiting:
        child = 2 * at + 1
        if child + 1 < waiting and _before(delayed, heap[child + 1], heap[child]):
            child += 1
        if not _before(delayed, heap[child], moved):
            break
        heap[at] = heap[child]
        at = child
    heap[at] = moved
    length, last = delayed.entries[number]["length"], number
    chunks = _chunks_of(length)
    for k in range(chunks):
        if k > 0:
            last = delayed.entries[last]["next"]
        begin = k * _CHUNK
        size = min(_CHUNK, length - begin)
        copy_bytes(data, begin, delayed.chunks[last], 0, size)
    delayed.entries[last]["next"] = state["first_free"]
    state["first_free"] = number
    state["free"] += chunks
    return int(number)


@compiled
def _before(delayed: Delayed, a: int, b: int) -> bool:
    first, second = delayed.entries[a], delayed.entries[b]
    if first["due_s"] != second["due_s"]:
        return bool(first["due_s"] < second["due_s"])
    return bool(first["order"] < second["order"])

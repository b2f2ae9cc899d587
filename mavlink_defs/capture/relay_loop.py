"""The compiled part of `mavlink_defs.capture.relay`: the loop that passes datagrams on.

`run` waits, receives, counts, impairs and delivers, and returns to Python for what is rare. A
datagram that it has received then stays where it is, and the next call continues with it.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from mavlink_defs.capture import delayed as waiting_room
from mavlink_defs.capture.delayed import (
    Delayed,
    Destination,
    add,
    earliest_s,
    has_room,
    new_delayed,
    take,
)
from mavlink_defs.capture.impairing import COPIES, Directions, put
from mavlink_defs.capture.tap_counts import Counts, count
from mavlink_defs.constants import MAX_DATAGRAM
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import borrowed, slot_of
from mavlink_defs.runtime.native import (
    ADDRESS_SIZE,
    POLLED,
    READABLE,
    monotonic_s,
    receive,
    receive_from_now,
    send,
    send_to,
    wait_for_any,
)

WAKE, FIRST_FRONT = 0, 1
"""Rows of `RelayState.polled`; peers are behind the fronts."""
NO_PEER = -1
_ROOM = 16  # peers at first
_FIXED_END = 1  # group of keys, see `_key`; the peers of front i are group 2 + i

STATE = np.dtype(
    [
        ("start_s", "f8"),  # what the tap's times count from [s]
        ("simulated", "i8"),  # 1: outages are in simulated time
        ("gated", "i8"),  # 1: Python is asked about every datagram
        ("row", "i8"),  # row of `polled` to check next
        ("from_row", "i8"),  # row from which the datagram in `received` came
        ("length", "i8"),  # its length [bytes]; -1: there is none
        ("allowed", "i8"),  # 1: Python was asked about it
        ("turn", "i8"),  # datagrams from peers so far
    ]
)
FRONT = np.dtype([("fd", "i8"), ("to", "i8"), ("back", "i8")])
WAY = np.dtype([("flow", "i8"), ("impaired", "i8"), ("undeliverable", "i8")])
PEER = np.dtype([("front", "i8"), ("fd", "i8"), ("turn", "i8")])


class Need(IntEnum):
    """Why the loop returns to Python."""

    NOTHING = 0  # there is no reason yet
    PAUSE = 1  # the wake-up socket has something
    GATE = 2  # may the datagram in `received` pass?
    PEER = 3  # it comes from a peer without a socket
    ROOM = 4  # a table is full, see `make_room`


class RelayState(NamedTuple):
    """Sockets, peers and what is in transit."""

    state: np.ndarray  # (1,), dtype STATE
    polled: np.ndarray  # (1 + fronts + peers,), dtype POLLED
    fronts: np.ndarray  # dtype FRONT
    targets: np.ndarray  # (fronts, ADDRESS_SIZE)
    ways: np.ndarray  # dtype WAY
    peers: np.ndarray  # dtype PEER; front NO_PEER: a free row
    addresses: np.ndarray  # (peers, ADDRESS_SIZE)
    keys: np.ndarray  # of `slot_of`, see `_key`
    rows: np.ndarray
    directions: Directions  # one for each way
    delayed: Delayed
    received: np.ndarray  # (MAX_DATAGRAM,)
    sender: np.ndarray  # (ADDRESS_SIZE,), where it came from, if from a peer
    sent: np.ndarray  # (MAX_DATAGRAM,)
    due_s: np.ndarray  # (COPIES,)
    copies: np.ndarray  # (COPIES, MAX_DATAGRAM)


def new_relay_state(
    wake_fd: int,
    fronts: Sequence[tuple[int, np.ndarray]],
    flows: Sequence[int],
    impaired: Sequence[bool],
    directions: Directions,
) -> RelayState:
    """Return a relay that knows no peer.

    Args:
        wake_fd: Socket on which the arrival of anything ends the loop.
        fronts: Socket and target's sockaddr of each route. Ways 2 i and 2 i + 1 are the two
            directions of route i.
        flows: Number of each way in the counts of the tap.
        impaired: Whether each way is impaired.
        directions: Impairment of each way.
    """
    n = len(fronts)
    state = np.zeros(1, STATE)
    state["length"], state["row"] = -1, 1 + n + _ROOM
    polled = np.zeros(1 + n + _ROOM, POLLED)
    polled["fd"], polled["events"] = -1, READABLE
    polled["fd"][: 1 + n] = [wake_fd, *(fd for fd, _ in fronts)]
    ways = np.zeros(2 * n, WAY)
    ways["flow"], ways["impaired"] = flows, impaired
    table = np.zeros(n, FRONT)
    table["fd"] = [fd for fd, _ in fronts]
    table["to"], table["back"] = 2 * np.arange(n), 2 * np.arange(n) + 1
    relay = RelayState(
        state=state,
        polled=polled,
        fronts=table,
        targets=np.array([target for _, target in fronts], np.uint8).reshape(n, ADDRESS_SIZE),
        ways=ways,
        peers=_no_peers(_ROOM),
        addresses=np.zeros((_ROOM, ADDRESS_SIZE), np.uint8),
        keys=np.zeros(0, np.int64),
        rows=np.zeros(0, np.int64),
        directions=directions,
        delayed=new_delayed(),
        received=np.zeros(MAX_DATAGRAM, np.uint8),
        sender=np.zeros(ADDRESS_SIZE, np.uint8),
        sent=np.zeros(MAX_DATAGRAM, np.uint8),
        due_s=np.zeros(COPIES),
        copies=np.zeros((COPIES, MAX_DATAGRAM), np.uint8),
    )
    return _indexed(relay)


def pause(relay: RelayState) -> None:
    """Let `run` return at once when it is called next."""
    relay.polled[WAKE]["found"], relay.state["row"] = 1, WAKE


def peers_of(relay: RelayState, front: int) -> np.ndarray:
    """Return the rows of a front's peers, the one without traffic for longest first."""
    rows = np.flatnonzero(relay.peers["front"] == front)
    return rows[np.argsort(relay.peers["turn"][rows], kind="stable")]


def free_row(relay: RelayState) -> tuple[RelayState, int]:
    """Return a free row of the peers, and the relay, in which there may have been none."""
    free = np.flatnonzero(relay.peers["front"] == NO_PEER)
    if not len(free):
        n = len(relay.peers)
        more = np.zeros(n, POLLED)
        more["fd"], more["events"] = -1, READABLE
        relay.state["row"] = len(relay.polled) + n
        relay = relay._replace(
            polled=np.concatenate([relay.polled, more]),
            peers=np.concatenate([relay.peers, _no_peers(n)]),
            addresses=np.concatenate([relay.addresses, np.zeros_like(relay.addresses)]),
        )
        return relay, n
    return relay, int(free[0])


def add_peer(relay: RelayState, row: int, front: int, fd: int) -> RelayState:
    """Return the relay with another peer: the sender of the datagram in `received`.

    Args:
        relay: The relay.
        row: A free row, of `free_row`.
        front: The front that it has sent to.
        fd: A socket for it, connected to the front's target.
    """
    relay.peers[row] = front, fd, relay.state[0]["turn"]
    relay.addresses[row] = relay.sender
    relay.polled[FIRST_FRONT + len(relay.fronts) + row]["fd"] = fd
    return _indexed(relay)


def forget_peer(relay: RelayState, row: int) -> RelayState:
    """Return the relay without a peer; what is in transit from it is undeliverable."""
    fd = relay.peers[row]["fd"]
    relay.delayed.entries["fd"][relay.delayed.entries["fd"] == fd] = -1
    relay.peers[row]["front"] = NO_PEER
    relay.polled[FIRST_FRONT + len(relay.fronts) + row]["fd"] = -1
    return _indexed(relay)


def make_room(relay: RelayState) -> RelayState:
    """Return the relay with room for copies of the datagram in `received`."""
    length = int(relay.state[0]["length"])
    return relay._replace(delayed=waiting_room.with_room(relay.delayed, length, COPIES))


def _no_peers(n: int) -> np.ndarray:
    peers = np.zeros(n, PEER)
    peers["front"] = NO_PEER
    return peers


def _indexed(relay: RelayState) -> RelayState:
    """Return the relay with the peers and fixed ends in its hash table."""
    entries = [(_key(_FIXED_END, target), i) for i, target in enumerate(relay.targets)]
    entries += [
        (_key(2 + int(relay.peers[row]["front"]), relay.addresses[row]), int(row))
        for row in np.flatnonzero(relay.peers["front"] != NO_PEER)
    ]
    size = 1 << (2 * len(entries)).bit_length()
    keys, rows = np.zeros(size, np.int64), np.zeros(size, np.int64)
    for key, row in entries:
        slot = slot_of(keys, key)
        keys[slot], rows[slot] = key, row
    return relay._replace(keys=keys, rows=rows)


@compiled
def _key(group: int, address: np.ndarray) -> int:
    """Return the key of a sockaddr_in: IPv4 address and port, and a group of addresses."""
    key = int(group)
    for k in range(2, 8):
        key = (key << 8) | int(np.int64(address[k]))
    return key


@compiled
def run(relay: RelayState, counts: Counts) -> Need:
    """Pass on datagrams until something needs Python.

    Args:
        relay: The relay.
        counts: The counts of its tap.
    """
    relay, counts = borrowed(relay), borrowed(counts)
    state = relay.state[0]
    while True:
        if state["length"] < 0:
            if _receive(relay):
                return Need.PAUSE
            if state["length"] < 0:
                _wait(relay)
                continue
        need = _pass_on(relay, counts)
        if need != Need.NOTHING:
            return need
        state["length"], state["allowed"] = -1, 0


@compiled
def _wait(relay: RelayState) -> None:
    """Wait until something is there, or due."""
    timeout_s = -1.0
    if relay.delayed.state[0]["waiting"] > 0:
        timeout_s = max(0.0, earliest_s(relay.delayed) - monotonic_s())
    if wait_for_any(relay.polled, timeout_s) > 0:
        relay.state[0]["row"] = 0
    if relay.delayed.state[0]["waiting"] > 0:
        _deliver_due(relay.delayed, relay.ways, relay.sent, monotonic_s())


@compiled
def _receive(relay: RelayState) -> bool:
    """Receive one datagram from the sockets found readable; return whether to pause."""
    state, polled = relay.state[0], relay.polled
    first_peer = FIRST_FRONT + len(relay.fronts)
    while state["row"] < len(polled):
        row = state["row"]
        state["row"] = row + 1
        if polled[row]["found"] == 0:
            continue
        polled[row]["found"] = 0
        if row == WAKE:
            return True
        if row < first_peer:
            length = receive_from_now(polled[row]["fd"], relay.received, relay.sender)
        else:  # -1 also if the fixed end is not there
            length = receive(polled[row]["fd"], relay.received)
        if length >= 0:
            state["length"], state["from_row"] = length, row
            return False
    return False


@compiled
def _pass_on(relay: RelayState, counts: Counts) -> Need:
    """Count, impair and deliver the datagram in `received`, unless Python has to help first."""
    state = relay.state[0]
    if state["gated"] != 0 and state["allowed"] == 0:
        return Need.GATE
    to = _destination(relay)
    if to.fd < 0:
        return Need.PEER
    way, length = relay.ways[to.way], state["length"]
    impaired = way["impaired"] != 0
    if impaired and not has_room(relay.delayed, length, COPIES):
        return Need.ROOM
    now_s = monotonic_s()
    schedule_s = now_s - state["start_s"]
    if not count(counts, schedule_s, way["flow"], relay.received, length):
        return Need.ROOM
    if not impaired:
        _deliver(relay.ways, to, relay.received, length)
        return Need.NOTHING
    if state["simulated"] != 0:
        schedule_s = counts.state[0]["simulated_s"]  # NaN, before it runs, is in no outage
    due_s, copies = relay.due_s, relay.copies
    arrivals = put(
        relay.directions, to.way, relay.received, length, now_s, schedule_s, due_s, copies
    )
    _deliver_due(relay.delayed, relay.ways, relay.sent, now_s)
    for k in range(arrivals):
        if due_s[k] <= now_s:
            _deliver(relay.ways, to, copies[k], length)
        else:
            add(relay.delayed, due_s[k], to, copies[k], length)
    return Need.NOTHING


@compiled
def _destination(relay: RelayState) -> Destination:
    """Return where the datagram in `received` goes; without a socket if its peer is unknown."""
    state = relay.state[0]
    i = state["from_row"] - FIRST_FRONT
    if i >= len(relay.fronts):
        peer = i - len(relay.fronts)
        front = relay.fronts[relay.peers[peer]["front"]]
        return Destination(front["back"], front["fd"], False, relay.addresses[peer])
    way, address = relay.fronts[i]["to"], relay.targets[i]
    behind = _row_of(relay.keys, relay.rows, relay.sender, _FIXED_END)
    if behind >= 0:
        return Destination(way, relay.fronts[behind]["fd"], False, address)
    peer = _row_of(relay.keys, relay.rows, relay.sender, 2 + i)
    if peer < 0:
        return Destination(way, -1, False, address)
    relay.peers[peer]["turn"] = state["turn"]
    state["turn"] += 1
    return Destination(way, relay.peers[peer]["fd"], True, address)


@compiled
def _row_of(keys: np.ndarray, rows: np.ndarray, address: np.ndarray, group: int) -> int:
    """Return the row of an address in a group of addresses, or -1."""
    key = _key(group, address)
    slot = slot_of(keys, key)
    return int(rows[slot]) if keys[slot] == key else -1


@compiled
def _deliver_due(delayed: Delayed, ways: np.ndarray, sent: np.ndarray, now_s: float) -> None:
    while earliest_s(delayed) <= now_s:
        number = take(delayed, sent)
        entry, address = delayed.entries[number], delayed.addresses[number]
        to = Destination(entry["way"], entry["fd"], entry["connected"] != 0, address)
        _deliver(ways, to, sent, entry["length"])


@compiled
def _deliver(ways: np.ndarray, to: Destination, data: np.ndarray, length: int) -> None:
    fd = to.fd
    sent = send(fd, data, length) if to.connected else send_to(fd, data, length, to.address)
    if sent < 0:
        ways[to.way]["undeliverable"] += 1

"""The compiled part of `mavlink_defs.capture.tap`: counts in arrays, by datagram.

Arrays do not grow by themselves. `count` refuses a datagram for which there might be too little
room, before it counts any of it, and `with_room` returns larger arrays with the same counts.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.framing import codec
from mavlink_defs.framing.codec import MessageId, checked_size, message_id_of
from mavlink_defs.framing.header import (
    COMPONENT,
    CRC_SIZE,
    FLAGS,
    HEADER_SIZE,
    MAGIC,
    MAX_FRAME_SIZE,
    PAYLOAD_SIZE,
    SIGNED_FLAG,
    SYSTEM,
)
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_bytes, slot_of

NEVER = 2**63 - 1
"""In place of an interval or a time [µs] that there is not."""

EMPTY, OLDER_VERSION = 0, 1
"""Columns of `Counts.dropped` for what is no `DropReason`: no bytes, MAVLink 1."""

_MIN_FRAME = HEADER_SIZE + CRC_SIZE
_V1_MAGIC: int = dialect.PROTOCOL_MARKER_V1
_EVENTS: int = dialect.MAVLink_ftc_events_message.id
_RUNNING: int = dialect.FTC_SIM_FLAGS_RUNNING
_ROOM = 256  # rows of each table at first

STATE = np.dtype(
    [
        ("window_s", "f8"),
        ("first_s", "f8"),  # time of the first datagram [s], NaN before
        ("last_s", "f8"),  # latest time of a datagram [s]
        ("simulated_s", "f8"),  # of the newest running step [s], NaN before
        ("flows", "i8"),  # rows in use
        ("streams", "i8"),
        ("uavs", "i8"),
        ("recent", "i8"),
        ("oldest", "i8"),  # row of the oldest in `recent`
    ]
)
FLOW = np.dtype(
    [
        ("link", "i8"),  # number of the link
        ("datagrams", "i8"),
        ("bytes", "i8"),
        ("recent", "i8"),  # datagrams within the window
        ("recent_bytes", "i8"),
    ]
)
STREAM = np.dtype(
    [("key", "i8"), ("frames", "i8"), ("bytes", "i8"), ("signed", "i8"), ("recent", "i8")]
)
UAV = np.dtype(
    [
        ("key", "i8"),  # 256 * number of the link + system
        ("messages", "i8"),
        ("repeats", "i8"),
        ("events", "i8", (N_CHANNELS,)),
        ("min_interval_us", "i8", (N_CHANNELS,)),  # NEVER: fewer than two events
        ("event_us", "i8", (N_CHANNELS,)),  # NEVER: none in this flight
        ("controls", "f4", (N_CHANNELS,)),
        ("has_controls", "i8"),  # 1: of this flight
        ("first_us", "i8"),
        ("last_us", "i8"),
        ("has_steps", "i8"),
        ("run", "i8"),
        ("first_step", "i8"),
        ("last_step", "i8"),
        ("steps_before", "i8"),  # of flights that are over
        ("report_size", "i8"),  # of the last FTC_EVENTS [bytes], 0: none
    ]
)
RECENT = np.dtype([("time_s", "f8"), ("stream", "i8"), ("flow", "i8"), ("size", "i8")])


class Counts(NamedTuple):
    """All counts of a tap."""

    state: np.ndarray  # (1,), dtype STATE
    flows: np.ndarray  # dtype FLOW
    dropped: np.ndarray  # (flows, codec.DROPS_SIZE), by negated `DropReason`
    stream_keys: np.ndarray  # of `slot_of`
    stream_rows: np.ndarray
    streams: np.ndarray  # dtype STREAM
    uav_keys: np.ndarray  # of `slot_of`
    uav_rows: np.ndarray
    uavs: np.ndarray  # dtype UAV
    reports: np.ndarray  # (uavs, MAX_FRAME_SIZE), last FTC_EVENTS
    recent: np.ndarray  # ring of what lies within the window, dtype RECENT; stream -1: a datagram
    payload: np.ndarray  # buffer of a payload
    sim_state: np.ndarray  # views of `payload`
    sim_step: np.ndarray
    actuators: np.ndarray


def new_counts(window_s: float, room: int = _ROOM) -> Counts:
    """Return counts of nothing.

    Args:
        window_s: Length of the window that rates are taken over [s].
        room: Rows of each table at first, a power of two.
    """
    state = np.zeros(1, STATE)
    state["window_s"], state["first_s"], state["simulated_s"] = window_s, np.nan, np.nan
    sizes = codec.SIM_STATE_SIZE, codec.SIM_STEP_SIZE, codec.ACTUATORS_SIZE
    payload = np.zeros(max(sizes), np.uint8)
    return Counts(
        state=state,
        flows=np.zeros(room, FLOW),
        dropped=np.zeros((room, codec.DROPS_SIZE), np.int64),
        stream_keys=np.zeros(2 * room, np.int64),
        stream_rows=np.zeros(2 * room, np.int64),
        streams=np.zeros(room, STREAM),
        uav_keys=np.zeros(2 * room, np.int64),
        uav_rows=np.zeros(2 * room, np.int64),
        uavs=np.zeros(room, UAV),
        reports=np.zeros((room, MAX_FRAME_SIZE), np.uint8),
        recent=np.zeros(room, RECENT),
        payload=payload,
        sim_state=payload[: codec.SIM_STATE_SIZE].view(codec.SIM_STATE),
        sim_step=payload[: codec.SIM_STEP_SIZE].view(codec.SIM_STEP),
        actuators=payload[: codec.ACTUATORS_SIZE].view(codec.ACTUATORS),
    )


def add_flow(counts: Counts, link: int) -> tuple[Counts, int]:
    """Return the counts with another direction of a link, and the direction's number."""
    flow = int(counts.state[0]["flows"])
    if flow == len(counts.flows):
        counts = counts._replace(flows=_doubled(counts.flows), dropped=_doubled(counts.dropped))
    counts.state[0]["flows"] += 1
    counts.flows[flow]["link"] = link
    return counts, flow


def with_room(counts: Counts, length: int) -> Counts:
    """Return the same counts, with room for a datagram of some length [bytes]."""
    frames, state = _most_frames(length), counts.state[0]
    while state["streams"] + frames > len(counts.streams):
        keys, rows = _indexed(counts.streams["key"], state["streams"])
        counts = counts._replace(
            streams=_doubled(counts.streams), stream_keys=keys, stream_rows=rows
        )
    while state["uavs"] + frames > len(counts.uavs):
        keys, rows = _indexed(counts.uavs["key"], state["uavs"])
        counts = counts._replace(
            uavs=_doubled(counts.uavs),
            reports=_doubled(counts.reports),
            uav_keys=keys,
            uav_rows=rows,
        )
    while state["recent"] + frames + 1 > len(counts.recent):
        in_order = np.roll(counts.recent, -int(state["oldest"]))
        state["oldest"] = 0
        counts = counts._replace(recent=_doubled(in_order))
    return counts


def _doubled(rows: np.ndarray) -> np.ndarray:
    return np.concatenate([rows, np.zeros_like(rows)])


def _indexed(keys: np.ndarray, used: int) -> tuple[np.ndarray, np.ndarray]:
    """Return hash tables from key to row for a table that is about to be doubled."""
    slots = np.zeros(4 * len(keys), np.int64)
    rows = np.zeros(4 * len(keys), np.int64)
    for row in range(used):
        slot = slot_of(slots, keys[row])
        slots[slot], rows[slot] = keys[row], row
    return slots, rows


@compiled
def _most_frames(length: int) -> int:
    return length // _MIN_FRAME + 1


@compiled
def count(counts: Counts, time_s: float, flow: int, data: np.ndarray, length: int) -> bool:
    """Count one datagram.

    Args:
        counts: The counts.
        time_s: Time of the datagram [s].
        flow: Number of the link's direction.
        data: Its UDP payload, uint8.
        length: Its length [bytes].

    Returns:
        Whether there was room; if not, nothing is counted.
    """
    state = counts.state[0]
    forget(counts, time_s)
    frames = _most_frames(length)
    if (
        state["streams"] + frames > len(counts.streams)
        or state["uavs"] + frames > len(counts.uavs)
        or state["recent"] + frames + 1 > len(counts.recent)
    ):
        return False
    if np.isnan(state["first_s"]):
        state["first_s"] = state["last_s"] = time_s
    state["last_s"] = max(state["last_s"], time_s)
    counts.flows[flow]["datagrams"] += 1
    counts.flows[flow]["bytes"] += length
    _remember(counts, time_s, -1, flow, length)
    at = 0
    while True:
        rest, left = data[at:], length - at
        size = checked_size(rest, left)
        if size < 0:
            column = -size
            if left == 0:
                column = EMPTY
            elif rest[MAGIC] == _V1_MAGIC:
                column = OLDER_VERSION
            counts.dropped[flow, column] += 1
            return True
        _count_frame(counts, time_s, flow, rest, size)
        at += size
        if at == length:
            return True


@compiled
def forget(counts: Counts, now_s: float) -> None:
    """Let what is older than the window no longer count as recent.

    Args:
        counts: The counts.
        now_s: The time [s].
    """
    state = counts.state[0]
    begin_s = now_s - state["window_s"]
    while state["recent"] > 0:
        oldest = counts.recent[state["oldest"]]
        if oldest["time_s"] > begin_s:
            return
        if oldest["stream"] < 0:
            counts.flows[oldest["flow"]]["recent"] -= 1
            counts.flows[oldest["flow"]]["recent_bytes"] -= oldest["size"]
        else:
            counts.streams[oldest["stream"]]["recent"] -= 1
        state["oldest"] = (state["oldest"] + 1) % len(counts.recent)
        state["recent"] -= 1


@compiled
def _remember(counts: Counts, time_s: float, stream: int, flow: int, size: int) -> None:
    """Count a datagram, or a frame of a stream, as recent."""
    state = counts.state[0]
    newest = counts.recent[(state["oldest"] + state["recent"]) % len(counts.recent)]
    newest["time_s"], newest["stream"], newest["flow"] = time_s, stream, flow
    newest["size"] = size
    state["recent"] += 1
    if stream < 0:
        counts.flows[flow]["recent"] += 1
        counts.flows[flow]["recent_bytes"] += size
    else:
        counts.streams[stream]["recent"] += 1


@compiled
def _count_frame(counts: Counts, time_s: float, flow: int, frame: np.ndarray, size: int) -> None:
    system, component = int(np.int64(frame[SYSTEM])), int(np.int64(frame[COMPONENT]))
    message_id = message_id_of(frame)
    key = ((flow + 1) << 40) | (system << 32) | (component << 24) | message_id
    stream = _row_of_stream(counts, key)
    row = counts.streams[stream]
    row["frames"] += 1
    row["bytes"] += size
    if frame[FLAGS] == SIGNED_FLAG:
        row["signed"] += 1
    _remember(counts, time_s, stream, flow, size)
    key = (counts.flows[flow]["link"] << 8) | system
    if message_id == MessageId.ACTUATORS:
        _copy_payload(counts.payload, frame)
        _note_transmission(_uav_of(counts, key), counts.actuators[0])
    elif message_id == MessageId.SIM_STATE:
        _copy_payload(counts.payload, frame)
        _note_state(counts, key, counts.sim_state[0])
    elif message_id == MessageId.SIM_STEP:
        _copy_payload(counts.payload, frame)
        _note_state(counts, key, counts.sim_step[0])
    elif message_id == _EVENTS:
        row_of_uav = _row_of_uav(counts, key)
        copy_bytes(counts.reports[row_of_uav], 0, frame, 0, size)
        counts.uavs[row_of_uav]["report_size"] = size


@compiled
def _row_of_stream(counts: Counts, key: int) -> int:
    slot = slot_of(counts.stream_keys, key)
    if counts.stream_keys[slot] == 0:
        row = counts.state[0]["streams"]
        counts.stream_keys[slot], counts.stream_rows[slot] = key, row
        counts.streams[row]["key"] = key
        counts.state[0]["streams"] += 1
    return int(counts.stream_rows[slot])


@compiled
def _row_of_uav(counts: Counts, key: int) -> int:
    slot = slot_of(counts.uav_keys, key + 1)
    if counts.uav_keys[slot] == 0:
        row = counts.state[0]["uavs"]
        counts.uav_keys[slot], counts.uav_rows[slot] = key + 1, row
        uav = counts.uavs[row]
        uav["key"] = key + 1
        for c in range(N_CHANNELS):
            uav["min_interval_us"][c] = uav["event_us"][c] = NEVER
        counts.state[0]["uavs"] += 1
    return int(counts.uav_rows[slot])


@compiled
def _uav_of(counts: Counts, key: int) -> np.void:
    row: np.void = counts.uavs[_row_of_uav(counts, key)]
    return row


@compiled
def _copy_payload(payload: np.ndarray, frame: np.ndarray) -> None:
    """Copy the payload of a frame, cut off or filled up with zeros."""
    size = min(int(np.int64(frame[PAYLOAD_SIZE])), payload.size)
    copy_bytes(payload, 0, frame, HEADER_SIZE, size)
    for k in range(size, payload.size):
        payload[k] = 0


@compiled
def _note_state(counts: Counts, key: int, state: np.void) -> None:
    """Note an FTC_SIM_STATE, or an FTC_SIM_STEP, of a UAV."""
    uav = _uav_of(counts, key)
    if state["flags"] & _RUNNING:
        _note_step(uav, int(np.int64(state["step"])), int(np.int64(state["run"])))
        counts.state[0]["simulated_s"] = np.float64(state["time_usec"]) / 1e6


@compiled
def _note_step(uav: np.void, step: int, run: int) -> None:
    """Note a control period, by its state or step; another run is another flight."""
    if uav["has_steps"] != 0 and run == uav["run"]:
        uav["first_step"] = min(uav["first_step"], step)
        uav["last_step"] = max(uav["last_step"], step)
        return
    if uav["has_steps"] != 0:
        uav["steps_before"] += uav["last_step"] - uav["first_step"] + 1
    uav["has_steps"], uav["run"] = 1, run
    uav["first_step"] = uav["last_step"] = step
    uav["has_controls"] = 0
    for c in range(N_CHANNELS):
        uav["event_us"][c] = NEVER


@compiled
def _note_transmission(uav: np.void, message: np.void) -> None:
    """Count the events of one HIL_ACTUATOR_CONTROLS."""
    time_us, changed = np.int64(message["time_usec"]), 0
    for c in range(N_CHANNELS):
        if uav["has_controls"] != 0 and message["controls"][c] == uav["controls"][c]:
            continue
        changed += 1
        uav["events"][c] += 1
        if uav["event_us"][c] != NEVER:
            interval_us = time_us - uav["event_us"][c]
            uav["min_interval_us"][c] = min(uav["min_interval_us"][c], interval_us)
        uav["event_us"][c] = time_us
    for c in range(N_CHANNELS):
        uav["controls"][c] = message["controls"][c]
    uav["has_controls"] = 1
    if changed == 0:
        uav["repeats"] += 1
    if uav["messages"] == 0:
        uav["first_us"] = uav["last_us"] = time_us
    uav["first_us"] = min(uav["first_us"], time_us)
    uav["last_us"] = max(uav["last_us"], time_us)
    uav["messages"] += 1

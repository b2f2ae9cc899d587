"""Hot-path codec: the messages of every control step, packed and checked by compiled code.

Hot are FTC_SIM_STATE, FTC_STEP_DONE, FTC_NEIGHBOUR and HIL_ACTUATOR_CONTROLS, and of a flight by
sensors HIL_SENSOR, HIL_GPS and FTC_SIM_STEP.
Their layout comes from the generated dialect, and the bytes equal pymavlink's. All other
messages are left to pymavlink.

To send, fill a record of your own and pack it into a datagram buffer; one buffer serves any
number of records, and packing never changes a record::

    state = np.zeros(1, SIM_STATE)
    datagram = new_buffer()
    state[0]["position"][2] = -1000.0
    length = pack(datagram, state, MessageId.SIM_STATE, system_id, component_id, sequence)

To receive, write the payload of a buffer to a record::

    datagram, state = new_buffer(), np.zeros(1, SIM_STATE)
    if check(datagram, length) == MessageId.SIM_STATE:
        unpack(datagram, state.view(np.uint8))
        z = state[0]["position"][2]

Wire format: MAVLink 2, https://mavlink.io/en/guide/serialization.html. One frame per datagram;
signed frames are recognised and left to `mavlink_defs.framing.hot_signing`.
"""

from enum import IntEnum

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.header import (
    COMPONENT,
    CRC_SIZE,
    FLAGS,
    HEADER_SIZE,
    MAGIC,
    MAX_FRAME_SIZE,
    MESSAGE_ID,
    PAYLOAD_SIZE,
    SEQUENCE,
    SIGNED_FLAG,
    SYSTEM,
    V2_MAGIC,
    whole_size,
)
from mavlink_defs.runtime.jit import compiled

BUFFER_SIZE = MAX_FRAME_SIZE
BUFFER = np.dtype([("bytes", "u1", (BUFFER_SIZE,))])
"""A datagram buffer in a record."""

# results of `check` in place of a message id, for valid frames that pymavlink has to decode
FOREIGN = -1
SIGNED = -2

DROPS_SIZE = 16
"""Counters of dropped datagrams: ``drops[-reason]`` for each `DropReason`."""


def payload_dtype(message_class: type[dialect.MAVLink_message]) -> np.dtype[np.void]:
    """Return the layout of a payload: packed, little endian, in wire order, arrays nested."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for name, code, length in zip(
        message_class.ordered_fieldnames,
        message_class.native_format.decode().lstrip("<"),
        message_class.array_lengths,
        strict=True,
    ):
        fields.append((name, np.dtype("<" + code).str, (length,) if length else ()))
    return np.dtype(fields)


SIM_STATE = payload_dtype(dialect.MAVLink_ftc_sim_state_message)
SIM_STEP = payload_dtype(dialect.MAVLink_ftc_sim_step_message)
HIL_SENSOR = payload_dtype(dialect.MAVLink_hil_sensor_message)
HIL_GPS = payload_dtype(dialect.MAVLink_hil_gps_message)
STEP_DONE = payload_dtype(dialect.MAVLink_ftc_step_done_message)
NEIGHBOUR = payload_dtype(dialect.MAVLink_ftc_neighbour_message)
ACTUATORS = payload_dtype(dialect.MAVLink_hil_actuator_controls_message)

SIM_STATE_SIZE = SIM_STATE.itemsize
SIM_STEP_SIZE = SIM_STEP.itemsize
NEIGHBOUR_SIZE = NEIGHBOUR.itemsize
ACTUATORS_SIZE = ACTUATORS.itemsize
REPORT_AT = dict(NEIGHBOUR.fields or {})["report"][1]
"""First byte of FTC_NEIGHBOUR.report in the payload."""
RELAYED_AT = dict(NEIGHBOUR.fields or {})["relayed"][1]
"""First byte of FTC_NEIGHBOUR.relayed, the last field."""


class MessageId(IntEnum):
    """Message ids of the hot messages."""

    SIM_STATE = dialect.MAVLink_ftc_sim_state_message.id
    SIM_STEP = dialect.MAVLink_ftc_sim_step_message.id
    SENSOR = dialect.MAVLink_hil_sensor_message.id
    GPS = dialect.MAVLink_hil_gps_message.id
    STEP_DONE = dialect.MAVLink_ftc_step_done_message.id
    NEIGHBOUR = dialect.MAVLink_ftc_neighbour_message.id
    ACTUATORS = dialect.MAVLink_hil_actuator_controls_message.id


_HOT = tuple((int(i), int(dialect.mavlink_map[int(i)].crc_extra)) for i in MessageId)
_IDS = np.array(sorted(dialect.mavlink_map), np.int64)
_EXTRAS = np.array([dialect.mavlink_map[int(i)].crc_extra for i in _IDS], np.int64)

size_by_header = compiled(whole_size)
"""`header.whole_size` in compiled code."""


def _crc_tables() -> np.ndarray:
    tables = np.zeros((8, 256), np.int32)
    for value in range(256):
        crc = value
        for _ in range(8):
            crc = (crc >> 1) ^ (0x8408 if crc & 1 else 0)
        tables[0, value] = crc
    for k in range(1, 8):  # table k: the same byte, followed by k zero bytes
        tables[k] = (tables[k - 1] >> 8) ^ tables[0, tables[k - 1] & 0xFF]
    return tables


_T = _crc_tables()


def new_buffer() -> np.ndarray:
    """Return a zeroed datagram buffer, uint8, shape (BUFFER_SIZE,)."""
    return np.zeros(BUFFER_SIZE, np.uint8)


def drop_counts(drops: np.ndarray) -> list[int]:
    """Return counters, shape (DROPS_SIZE,), as in FTC_DROPS: in order, at most UINT32_MAX."""
    return [min(int(drops[-reason]), 2**32 - 1) for reason in DropReason]


@compiled
def pack(
    datagram: np.ndarray,
    payload: np.ndarray,
    message_id: int,
    system_id: int,
    component_id: int,
    sequence: int,
) -> int:
    """Write one hot message into a datagram buffer.

    Args:
        datagram: Buffer to write to, from `new_buffer`.
        payload: The message, shape (1,), of the dtype that belongs to `message_id`; unchanged.
            One row of a longer array is the slice ``rows[i : i + 1]``.
        message_id: A `MessageId`.
        system_id: Sender's system id, 1 to 255.
        component_id: Sender's component id.
        sequence: Number of frames sent before; its low byte goes out.

    Returns:
        Length of the datagram [bytes].

    Raises:
        ValueError: `message_id` is not a hot message.
    """
    if _crc_extra(message_id) < 0:
        raise ValueError("not a hot message")
    source = payload.view(np.uint8)
    return pack_bytes(datagram, source, message_id, system_id, component_id, sequence)


@compiled
def pack_bytes(
    datagram: np.ndarray,
    source: np.ndarray,
    message_id: int,
    system_id: int,
    component_id: int,
    sequence: int,
) -> int:
    """Write one hot message, as `pack` does, from the bytes of its payload, uint8."""
    size = source.size
    while size > 1 and source[size - 1] == 0:  # MAVLink 2: trailing zeros are not sent
        size -= 1
    datagram[MAGIC] = V2_MAGIC
    datagram[PAYLOAD_SIZE] = size
    datagram[FLAGS] = 0
    datagram[FLAGS + 1] = 0  # compatibility flags
    datagram[SEQUENCE] = sequence & 0xFF
    datagram[SYSTEM] = system_id
    datagram[COMPONENT] = component_id
    datagram[MESSAGE_ID] = message_id & 0xFF
    datagram[MESSAGE_ID + 1] = (message_id >> 8) & 0xFF
    datagram[MESSAGE_ID + 2] = message_id >> 16
    for i in range(size):
        datagram[HEADER_SIZE + i] = source[i]
    add_checksum(datagram)
    return HEADER_SIZE + size + CRC_SIZE


@compiled
def add_checksum(datagram: np.ndarray) -> None:
    """Write the checksum of a hot message in a datagram buffer."""
    end = HEADER_SIZE + _byte(datagram, PAYLOAD_SIZE)
    crc = checksum(datagram, end, _crc_extra(message_id_of(datagram)))
    datagram[end] = crc & 0xFF
    datagram[end + 1] = crc >> 8


@compiled
def check(datagram: np.ndarray, length: int) -> int:
    """Classify a received datagram.

    Args:
        datagram: Buffer from `new_buffer`, filled from the wire.
        length: Number of bytes received, 0 to BUFFER_SIZE.

    Returns:
        The message id of a valid hot message, or a negative code: FOREIGN and SIGNED for a
        complete frame that the codec does not check (its checksum is left to pymavlink), or a
        `DropReason`. A payload may be longer than ours (fields of a newer dialect).
    """
    size = size_by_header(datagram, length)
    if size < 0:
        return size
    if size != length:
        return DropReason.BAD_LENGTH
    if _byte(datagram, FLAGS) == SIGNED_FLAG:
        return SIGNED
    return identify(datagram)


@compiled
def identify(datagram: np.ndarray) -> int:
    """Return the id of a whole hot frame whose checksum is right; else FOREIGN or BAD_CRC.

    For frames whose signature has been checked; `check` does it for unsigned ones.
    """
    message_id = message_id_of(datagram)
    extra = _crc_extra(message_id)
    if extra < 0:
        return FOREIGN
    return message_id if _is_intact(datagram, extra) else DropReason.BAD_CRC


@compiled
def checked_size(data: np.ndarray, length: int) -> int:
    """Return the size of the MAVLink 2 frame of the dialect that data[:length] begins with.

    As `frames.frame_size`: any message of the dialect, not only hot ones.

    Args:
        data: Bytes, uint8.
        length: How many of them were received.

    Returns:
        The size [bytes], or a negative `DropReason`. Signatures are not verified.
    """
    size = size_by_header(data, length)
    if size < 0:
        return size
    message_id = message_id_of(data)
    low, high = 0, _IDS.size - 1
    while low < high:
        middle = (low + high) // 2
        if _IDS[middle] < message_id:
            low = middle + 1
        else:
            high = middle
    if _IDS[low] != message_id:
        return DropReason.UNEXPECTED
    return size if _is_intact(data, _EXTRAS[low]) else DropReason.BAD_CRC


@compiled
def _is_intact(datagram: np.ndarray, extra: int) -> bool:
    """Return whether the checksum of a whole frame is right, with the message's CRC_EXTRA."""
    end = HEADER_SIZE + _byte(datagram, PAYLOAD_SIZE)
    crc = checksum(datagram, end, extra)
    return bool(datagram[end] == crc & 0xFF and datagram[end + 1] == crc >> 8)


@compiled
def unpack(datagram: np.ndarray, payload: np.ndarray) -> None:
    """Write the payload of a checked frame, whose trailing zeros were not sent, to a record.

    Args:
        datagram: Buffer whose frame `check` has accepted.
        payload: Bytes of the record, uint8, as of `memory.bytes_of`; written.
    """
    size = min(_byte(datagram, PAYLOAD_SIZE), payload.size)
    for k in range(size):
        payload[k] = datagram[HEADER_SIZE + k]
    for k in range(size, payload.size):
        payload[k] = 0


@compiled
def copy_step(source: np.void, target: np.void) -> None:
    """Copy what an FTC_SIM_STEP has, and an FTC_SIM_STATE beside the motion.

    Args:
        source: Payload of dtype `SIM_STATE` or `SIM_STEP`.
        target: The same of either, written.
    """
    target["time_usec"], target["step"] = source["time_usec"], source["step"]
    target["actuator_time_usec"] = source["actuator_time_usec"]
    target["run"], target["flags"] = source["run"], source["flags"]
    for k in range(len(target["silent"])):
        target["silent"][k] = source["silent"][k]


@compiled
def system_of(datagram: np.ndarray) -> int:
    """Return the sender's system id of a checked frame."""
    return _byte(datagram, SYSTEM)


@compiled
def _byte(datagram: np.ndarray, i: int) -> int:
    return int(np.int64(datagram[i]))  # compiled, an unsigned and a signed int would make a float


@compiled
def message_id_of(datagram: np.ndarray) -> int:
    """Return the message id in the header of a frame."""
    low, middle = _byte(datagram, MESSAGE_ID), _byte(datagram, MESSAGE_ID + 1)
    return low + (middle << 8) + (_byte(datagram, MESSAGE_ID + 2) << 16)


@compiled
def _crc_extra(message_id: int) -> int:
    for hot, extra in _HOT:
        if message_id == hot:
            return extra
    return -1


@compiled
def checksum(b: np.ndarray, end: int, extra: int) -> int:
    """Return CRC-16/MCRF4XX of b[1:end] and the message's CRC_EXTRA, eight bytes at a time."""
    crc = 0xFFFF
    i = 1
    while i + 8 <= end:
        crc = (
            _T[7, (crc & 0xFF) ^ b[i]]
            ^ _T[6, (crc >> 8) ^ b[i + 1]]
            ^ _T[5, b[i + 2]]
            ^ _T[4, b[i + 3]]
            ^ _T[3, b[i + 4]]
            ^ _T[2, b[i + 5]]
            ^ _T[1, b[i + 6]]
            ^ _T[0, b[i + 7]]
        )
        i += 8
    while i < end:
        crc = (crc >> 8) ^ _T[0, (crc & 0xFF) ^ b[i]]
        i += 1
    return int((crc >> 8) ^ _T[0, (crc & 0xFF) ^ extra])

"""Time to pack and to read one hot message: the compiled codec beside pymavlink.

Both process the same messages, in alternating rounds, so that a slow moment of the machine hits
both; each figure is the median of its rounds.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing import codec
from mavlink_defs.runtime.jit import compiled

ROUNDS = 9
OUR_REPEATS = 100_000
THEIR_REPEATS = 2_000

MESSAGES = (
    (codec.MessageId.SIM_STATE, codec.SIM_STATE, dialect.MAVLink_ftc_sim_state_message),
    (codec.MessageId.ACTUATORS, codec.ACTUATORS, dialect.MAVLink_hil_actuator_controls_message),
    (codec.MessageId.NEIGHBOUR, codec.NEIGHBOUR, dialect.MAVLink_ftc_neighbour_message),
    (codec.MessageId.STEP_DONE, codec.STEP_DONE, dialect.MAVLink_ftc_step_done_message),
)


class CodecRow(NamedTuple):
    """Medians for one message [µs]."""

    message: str
    pack_ours_us: float
    pack_pymavlink_us: float
    parse_ours_us: float
    parse_pymavlink_us: float


def codec_table() -> list[CodecRow]:
    """Measure every hot message; takes about five seconds."""
    return [_measure(*message) for message in MESSAGES]


def main() -> None:
    """Print the table."""
    print(f"{'µs per message':22} {'pack':>8} {'pymavlink':>10} {'parse':>8} {'pymavlink':>10}")
    for row in codec_table():
        print(
            f"{row.message:22} {row.pack_ours_us:8.3f} {row.pack_pymavlink_us:10.2f}"
            f" {row.parse_ours_us:8.3f} {row.parse_pymavlink_us:10.2f}"
        )


def _measure(
    message_id: int, dtype: np.dtype[np.void], message_class: type[dialect.MAVLink_message]
) -> CodecRow:
    payload = np.zeros(1, dtype)
    payload.view(np.uint8)[:] = np.arange(1, dtype.itemsize + 1)
    datagram = codec.new_buffer()
    length = codec.pack(datagram, payload, message_id, 1, 1, 0)
    frame = bytearray(datagram[:length])
    values = {name: payload[0][name].tolist() for name in dtype.names or ()}
    mavlink = dialect.MAVLink(None, 1, 1)

    def pack_by_pymavlink() -> None:
        for _ in range(THEIR_REPEATS):
            message_class(**values).pack(mavlink)

    def parse_by_pymavlink() -> None:
        for _ in range(THEIR_REPEATS):
            mavlink.decode(frame)

    works: list[tuple[Callable[[], object], int]] = [
        (lambda: pack_often(datagram, payload, message_id, OUR_REPEATS), OUR_REPEATS),
        (pack_by_pymavlink, THEIR_REPEATS),
        (lambda: parse_often(datagram, length, payload.view(np.uint8), OUR_REPEATS), OUR_REPEATS),
        (parse_by_pymavlink, THEIR_REPEATS),
    ]
    for work, _ in works:  # compile and warm up
        work()
    rounds = [[_time_us(work) / repeats for work, repeats in works] for _ in range(ROUNDS)]
    return CodecRow(
        message_class.msgname, *(median(column) for column in zip(*rounds, strict=True))
    )


def _time_us(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return (time.perf_counter() - start) * 1e6


@compiled
def pack_often(datagram: np.ndarray, payload: np.ndarray, message_id: int, repeats: int) -> int:
    total = 0
    for i in range(repeats):
        total += codec.pack(datagram, payload, message_id, 1, 1, i)
    return total


@compiled
def parse_often(datagram: np.ndarray, length: int, payload: np.ndarray, repeats: int) -> int:
    total = 0
    for _ in range(repeats):
        total += codec.check(datagram, length)
        codec.unpack(datagram, payload)
    return total


if __name__ == "__main__":
    main()

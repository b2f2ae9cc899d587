"""Telemetry logs: every frame with its time, as MAVProxy, QGroundControl and pymavlink write.

A record is a big-endian 64-bit time [µs] and the raw MAVLink frame; nothing else is in a file.
pymavlink's readers use the two low bits of the time as a link number, and otherwise as time.
"""

import contextlib
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Self

from mavlink_defs import dialect
from mavlink_defs.config.output_files import named, naming
from mavlink_defs.config.user_files import open_file
from mavlink_defs.framing.header import CRC_SIZE, V2_MAGIC, FrameHeader

_FLUSH_PERIOD_S = 1.0
_TIME = struct.Struct(">Q")


class TlogError(ValueError):
    """The file is not a telemetry log."""


class TlogCutOff(TlogError):  # noqa: N818 - the name says it
    """The file ends within a record; the records before it are readable."""


class TlogWriter:
    """Writes a telemetry log; a context manager.

    A run that is killed loses at most the frames since a second before the last one.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._flushed_at = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        with contextlib.nullcontext() if error is None else contextlib.suppress(OSError):
            self.close()

    def write(self, frame: bytes, time_us: int) -> None:
        """Append one frame (all of it, and nothing else) with its time [µs since 1970].

        Raises:
            OSError: The disk is full, or the like; it names the file.
        """
        try:
            self._file.write(_TIME.pack(time_us) + frame)
            now = time.monotonic()
            if now - self._flushed_at >= _FLUSH_PERIOD_S:
                self._file.flush()
                self._flushed_at = now
        except OSError as problem:
            raise named(problem, self._file.name) from None

    def close(self) -> None:
        """Write out what is buffered, and close the file.

        Raises:
            OSError: As `write`.
        """
        with naming(self._file.name):
            self._file.close()


def read_tlog(path: Path) -> Iterator[tuple[int, dialect.MAVLink_message]]:
    """Read a telemetry log: pairs of time [µs] and message.

    A frame with a wrong checksum comes as MAVLink_bad_data, one of a message that the dialect
    does not know as MAVLink_unknown. A record cut off at the end of the file is left out.
    Signatures are not checked.

    Raises:
        TlogError: There are bytes other than a frame where one should begin.
        OSError: The file cannot be read.
    """
    parser = dialect.MAVLink(None)
    for time_us, frame in read_frames(path):
        try:
            message = parser.decode(bytearray(frame))
        except dialect.MAVError as exc:
            message = dialect.MAVLink_bad_data(bytearray(frame), str(exc))
        yield time_us, message


def read_frames(path: Path, complain: bool = False) -> Iterator[tuple[int, bytes]]:
    """Read a telemetry log without looking into its frames: pairs of time [µs] and frame.

    Args:
        path: The log.
        complain: Raise when a record is cut off, after all before it; else leave it out.

    Raises:
        TlogCutOff: The last record is not whole, and that matters.
        TlogError, OSError: As `read_tlog`.
    """
    with open_file(path) as file, contextlib.ExitStack() as stack:
        if not complain:
            stack.enter_context(contextlib.suppress(TlogCutOff))
        while (record := _read_record(file, path)) is not None:
            yield record


def _read_record(file: BinaryIO, path: Path) -> tuple[int, bytes] | None:
    start = file.tell()
    head = file.read(_TIME.size + 3)
    if not head:
        return None
    cut_off = TlogCutOff(f"{path}: cut off in the record at byte {start}")
    if len(head) < _TIME.size + 3:
        raise cut_off
    magic, payload_size, flags = head[_TIME.size :]
    if magic == V2_MAGIC:
        size = FrameHeader(payload_size, flags).frame_size
    elif magic == dialect.PROTOCOL_MARKER_V1:
        size = dialect.HEADER_LEN_V1 + payload_size + CRC_SIZE
    else:
        raise TlogError(f"{path}: no MAVLink frame at byte {start + _TIME.size}")
    rest = file.read(size - 3)
    if len(rest) < size - 3:
        raise cut_off
    return int(_TIME.unpack_from(head)[0]), head[_TIME.size :] + rest

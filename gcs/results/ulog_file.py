"""Writing ULog, PX4's log format, as of https://docs.px4.io/v1.16/en/dev_log/ulog_file_format.html.

A file is a header, definitions (information, parameters, formats of topics), and data: messages
of the topics that are subscribed to, and texts. pyulog, PX4's own library, writes only what it has
read before.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import BinaryIO

import numpy as np

_MAGIC = b"ULog\x01\x12\x35"
_VERSION = 1
_FLAGS = bytes(40)  # nothing special: no appended data, no incompatible parts
_TYPES = {
    "uint64_t": "<u8",
    "double": "<f8",
    "uint32_t": "<u4",
    "int32_t": "<i4",
    "float": "<f4",
    "uint16_t": "<u2",
    "uint8_t": "u1",
    "int8_t": "i1",
    "bool": "u1",
}
"""Types of fields and how numpy has them."""
_HEADER = [("size", "<u2"), ("kind", "u1"), ("number", "<u2")]
_HEADER_SIZE = 3  # bytes of it that do not count as size


class Level(IntEnum):
    """How important a text is, as in a system log."""

    ERROR = ord("3")
    WARNING = ord("4")
    INFO = ord("6")


@dataclass(frozen=True)
class Topic:
    """A topic and the format of its messages.

    Attributes:
        name: As PX4 names it.
        number: Its number in the file.
        fields: Name, type and length of each field, after the timestamp.
    """

    name: str
    number: int
    fields: Sequence[tuple[str, str, int]]

    @cached_property
    def _ordered(self) -> list[tuple[str, str, int]]:
        """The fields as PX4 logs them: the timestamp, then the largest, so that none is padded."""
        widest = sorted(self.fields, key=lambda field: -np.dtype(_TYPES[field[1]]).itemsize)
        return [("timestamp", "uint64_t", 1), *widest]

    @property
    def format(self) -> str:
        """The format as text."""
        parts = (
            f"{kind}[{length}] {name};" if length > 1 else f"{kind} {name};"
            for name, kind, length in self._ordered
        )
        return f"{self.name}:{''.join(parts)}"

    @cached_property
    def _message(self) -> np.dtype:
        """Type of a whole message."""
        fields = [
            (name, _TYPES[kind], (length,)) if length > 1 else (name, _TYPES[kind])
            for name, kind, length in self._ordered
        ]
        return np.dtype([*_HEADER, *fields])

    def messages(self, timestamps_us: np.ndarray) -> np.ndarray:
        """Return messages to fill in: floating point numbers are NaN, all others 0.

        Args:
            timestamps_us: Shape (messages,).

        Returns:
            Shape (messages,); its fields are the header's and then the topic's.
        """
        made = np.zeros(len(timestamps_us), self._message)
        made["size"] = self._message.itemsize - _HEADER_SIZE
        made["kind"], made["number"] = ord("D"), self.number
        made["timestamp"] = timestamps_us
        for name, kind, _ in self.fields:
            if kind in {"float", "double"}:
                made[name] = np.nan
        return made


class UlogWriter:
    """Writes the parts of a file, in the order in which a reader needs them."""

    def __init__(
        self,
        file: BinaryIO,
        start_us: int,
        information: Mapping[str, str | int],
        parameters: Mapping[str, int | float],
        topics: Sequence[Topic],
    ) -> None:
        """Write header and definitions.

        Args:
            file: Where to.
            start_us: When the log starts [µs].
            information: Texts, 32-bit integers (``int32_t time_ref_utc``) and versions; those
                whose names end with ``_release`` are unsigned.
            parameters: 32-bit integers and floats by name.
            topics: Those that have messages.
        """
        self._file = file
        file.write(_MAGIC + struct.pack("<BQ", _VERSION, start_us))
        self._message("B", _FLAGS)
        for topic in topics:
            self._message("F", topic.format.encode())
        for key, value in information.items():
            if isinstance(value, str):
                self._value("I", f"char[{len(value.encode())}]", key, value.encode())
            else:
                unsigned = key.endswith("_release")
                data = struct.pack("<I" if unsigned else "<i", value)
                self._value("I", "uint32_t" if unsigned else "int32_t", key, data)
        for key, number in parameters.items():
            whole = isinstance(number, int)
            data = struct.pack("<i" if whole else "<f", number)
            self._value("P", "int32_t" if whole else "float", key, data)
        for topic in topics:
            self._message("A", struct.pack("<BH", 0, topic.number) + topic.name.encode())

    def add(self, messages: bytes) -> None:
        """Write whole messages, as of `Topic.messages` and `text_message`."""
        self._file.write(messages)

    def _value(self, kind: str, of: str, key: str, value: bytes) -> None:
        name = f"{of} {key}".encode()
        self._message(kind, struct.pack("<B", len(name)) + name + value)

    def _message(self, kind: str, content: bytes) -> None:
        self._file.write(_framed(kind, content))


def text_message(timestamp_us: int, level: Level, text: str) -> bytes:
    """Return a text of the vehicle as a message."""
    return _framed("L", struct.pack("<BQ", level, timestamp_us) + text.encode())


def _framed(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content

"""Writing small logs of ArduPilot, message by message, as its firmware does."""

import struct
from collections.abc import Iterable
from pathlib import Path

_FMT = 0x80
_PACKED = {"Q": "Q", "f": "f", "B": "B", "H": "H", "L": "i", "c": "h", "I": "I", "N": "16s"}
_PACKED |= {"Z": "64s", "n": "4s", "e": "i", "C": "H"}


class DataflashWriter:
    """A log whose formats are described before their first message."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._formats: dict[str, tuple[int, str]] = {}
        self._define("FMT", _FMT, "BBnNZ", "Type,Length,Name,Format,Columns")

    def _define(self, name: str, number: int, form: str, columns: str) -> None:
        self._formats[name] = (number, form)
        size = 3 + struct.calcsize("<" + "".join(_PACKED[one] for one in form))
        self.add("FMT", number, size, name.encode(), form.encode(), columns.encode())

    def define(self, name: str, form: str, columns: str) -> None:
        """Describe messages: a letter for each column, as ArduPilot's LogStructure.h has them."""
        self._define(name, len(self._formats), form, columns)

    def add(self, name: str, *values: float | bytes) -> None:
        """Append a message."""
        number, form = self._formats[name]
        layout = "<" + "".join(_PACKED[one] for one in form)
        self._data += b"\xa3\x95" + bytes([number]) + struct.pack(layout, *values)

    def add_all(self, name: str, rows: Iterable[Iterable[float]]) -> None:
        """Append messages of numbers, whole ones where the format has such."""
        whole = [_PACKED[one] not in {"f"} for one in self._formats[name][1]]
        for row in rows:
            self.add(name, *(int(v) if w else v for v, w in zip(row, whole, strict=True)))

    def save(self, path: Path, keep: float = 1.0) -> Path:
        """Write the log, or a part of it as of one that was cut off."""
        path.write_bytes(self._data[: int(len(self._data) * keep)])
        return path

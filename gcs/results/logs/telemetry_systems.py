"""What a telemetry log has of each system: messages of one kind together, as arrays."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fastcrc.crc16 import mcrf4xx

from gcs.console.errors import BadInput
from gcs.results.logs.fields import Values
from gcs.results.logs.reading import reading
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogError, read_frames
from mavlink_defs.framing.header import CRC_SIZE, HEADER_SIZE, V2_MAGIC

_KINDS = {kind.msgname: kind for kind in dialect.mavlink_map.values()}


class MessageKind(NamedTuple):
    """All messages of one kind: where in the log, and their payloads."""

    places: list[int]
    payloads: list[bytes]


@dataclass(frozen=True)
class HeardSystem:
    """What was heard of a system.

    Attributes:
        time_s: Time of reception of every frame of the log [s].
        kinds: Its messages by name.
    """

    time_s: np.ndarray
    kinds: Mapping[str, MessageKind]

    def values(self, name: str) -> Values:
        """Return the fields of all messages of a kind; elements of arrays as ``name[0]``."""
        if name not in self.kinds:
            return {}
        layout = layout_of(name)
        size = layout.itemsize
        whole = b"".join(one[:size].ljust(size, b"\0") for one in self.kinds[name].payloads)
        rows = np.frombuffer(whole, layout)
        found: dict[str, np.ndarray] = {}
        for field in layout.names or ():
            column = rows[field]
            if column.ndim == 1:
                found[field] = column
            else:
                found |= {f"{field}[{k}]": column[:, k] for k in range(column.shape[1])}
        return found

    def heard_s(self, name: str) -> np.ndarray:
        """Return when each message of a kind was heard [s]."""
        return self.time_s[self.kinds[name].places]

    def own_s(self, name: str) -> np.ndarray | None:
        """Return the vehicle's own times of a kind [s]; None if it has none."""
        values = self.values(name)
        if "time_boot_ms" in values:
            return np.asarray(_unwrapped(values["time_boot_ms"]) / 1e3)
        if "time_usec" in values and values["time_usec"].any():
            return np.asarray(_unwrapped(values["time_usec"]) / 1e6)
        return None

    @cached_property
    def heartbeat(self) -> dict[str, int]:
        """The last HEARTBEAT; empty without one."""
        return {name: int(column[-1]) for name, column in self.values("HEARTBEAT").items()}


def read_systems(path: Path) -> tuple[dict[int, HeardSystem], list[str]]:
    """Return what each system of a log sent, and remarks.

    Raises:
        BadInput: It cannot be read, or has no frame.
    """
    times: list[int] = []
    found: dict[int, dict[str, MessageKind]] = defaultdict(dict)
    wrong: Counter[str] = Counter()
    remarks = []
    try:
        for time_us, frame in _frames(path):
            times.append(time_us)
            if frame[0] == V2_MAGIC:
                begin, size, system = HEADER_SIZE, frame[1], frame[5]
                number = int.from_bytes(frame[7:10], "little")
            else:
                begin, size, system, number = dialect.HEADER_LEN_V1, frame[1], frame[3], frame[5]
            kind = dialect.mavlink_map.get(number)
            end = begin + size
            if kind is None:
                wrong["are of messages that common.xml does not have"] += 1
                continue
            checksum = mcrf4xx(frame[1:end] + bytes((kind.crc_extra,)))
            if checksum.to_bytes(CRC_SIZE, "little") != frame[end : end + CRC_SIZE]:
                wrong["have a wrong checksum"] += 1
                continue
            places, payloads = found[system].setdefault(kind.msgname, MessageKind([], []))
            places.append(len(times) - 1)
            payloads.append(frame[begin:end])
    except TlogError as problem:
        if not found:
            raise BadInput(str(problem), "telemetry logs are .tlog of a ground station") from None
        remarks.append(f"only its first {len(times)} frames are read: {problem}")
    if not found:
        raise BadInput(f"{path}: no MAVLink frame in it")
    remarks += [f"{number} of {len(times)} frames {what}" for what, number in wrong.items()]
    time_s = np.array(times) / 1e6
    return {system: HeardSystem(time_s, kinds) for system, kinds in found.items()}, remarks


def _frames(path: Path) -> Iterator[tuple[int, bytes]]:
    with reading(path):
        yield from read_frames(path, complain=True)


@cache
def layout_of(name: str) -> np.dtype:
    """Return the payload of a kind as the wire has it."""
    kind = _KINDS[name]
    codes = kind.native_format.decode().lstrip("<")
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for field, length, code in zip(kind.ordered_fieldnames, kind.array_lengths, codes, strict=True):
        if code == "c":
            fields.append((field, f"S{max(length, 1)}"))
        else:
            fields.append((field, f"<{code}", (length,)) if length else (field, f"<{code}"))
    return np.dtype(fields)


def _unwrapped(stamps: np.ndarray) -> np.ndarray:
    """Return times that count on where 32 bits begin again."""
    if stamps.dtype.itemsize > 4:
        return stamps.astype(float)
    wide = stamps.astype(np.int64)
    again = np.append(0, np.cumsum(np.diff(wide) < -(2**31)))
    return np.asarray(wide + again * 2**32, float)

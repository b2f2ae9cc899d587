"""The checkpoint from which an autopilot resumes if its process dies: a file in shared memory.

The compiled loop copies its records into the file after each control step, before the step's
messages are sent; that is a copy in memory, and the system writes the file later. So an event is
in the file before it is on the wire: it is counted once, and sent again if it did not go out.

The file holds two slots, written in turn. Each has a count and a checksum, so that a slot
that was being written when the process died is not taken for a whole one.
"""

import hashlib
import mmap
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.estimator import Estimator
from mavlink_defs.config.output_files import naming
from mavlink_defs.runtime.jit import compiled

VEHICLE = np.dtype([("mode", "i8"), ("item", "i8")])
"""Of a vehicle, besides its compiled records: custom_mode, current mission item."""

N_PARTS = 14 + len(Estimator._fields)
_HEAD = 16  # bytes of a slot before its parts: count, checksum
_DIGEST = 64  # bytes of the file before the slots
_FNV_START, _FNV_PRIME = 0x811C9DC5, 0x01000193


class Checkpoint(NamedTuple):
    """The file of an autopilot and the records saved in it; without slots nothing is saved."""

    slots: np.ndarray  # (2, size), bytes in the file
    as_u64: np.ndarray  # (2, size / 8), the same: count, checksum, the rest
    as_u32: np.ndarray  # (2, size / 4), the same
    written: np.ndarray  # (1,), how often a slot was written
    parts: tuple[np.ndarray, ...]  # the bytes of each record, N_PARTS of them


def no_checkpoint() -> Checkpoint:
    """Return a checkpoint that saves nothing."""
    none = np.zeros(0, np.uint8)
    return Checkpoint(
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 0), np.uint64),
        np.zeros((0, 0), np.uint32),
        np.zeros(1, np.uint64),
        (none,) * N_PARTS,
    )


def open_checkpoint(path: Path, records: Sequence[np.ndarray], configuration: str) -> Checkpoint:
    """Open the file of an autopilot, or make it; its space on the disk is taken at once.

    Args:
        path: The file.
        records: What is saved, `N_PARTS` arrays.
        configuration: A text that identifies the configuration; a file of another one, or of
            records of other types, is cleared.

    Raises:
        OSError: The file cannot be made; it is named.
    """
    parts = tuple(record.reshape(-1).view(np.uint8) for record in records)
    assert len(parts) == N_PARTS
    size = -(-(_HEAD + sum(map(len, parts))) // 8) * 8
    described = [configuration, *(str(record.dtype.descr) for record in records)]
    digest = hashlib.sha512("\n".join(described).encode()).digest()
    content = map_array(path, np.dtype(np.uint8), _DIGEST + 2 * size)
    if content[:_DIGEST].tobytes() != digest:
        content[:] = 0
        content[:_DIGEST] = np.frombuffer(digest, np.uint8)
    slots = content[_DIGEST:].reshape(2, size)
    as_u64 = slots.view(np.uint64)
    written = as_u64[:, 0].max(keepdims=True)
    return Checkpoint(slots, as_u64, slots.view(np.uint32), written, parts)


def restore(saved: Checkpoint) -> bool:
    """Restore the records that a checkpoint was opened with; False if it holds none."""
    for slot in np.argsort(saved.as_u64[:, 0])[::-1]:
        if saved.as_u64[slot, 0] == 0 or saved.as_u64[slot, 1] != checksum(saved.as_u32[slot]):
            continue
        begin = _HEAD
        for part in saved.parts:
            part[:] = saved.slots[slot, begin : begin + len(part)]
            begin += len(part)
        return True
    return False


@compiled
def save(to: Checkpoint) -> None:
    """Write the records into the slot whose turn it is; do nothing without a file."""
    if len(to.slots) == 0:
        return
    to.written[0] += np.uint64(1)
    slot = int(to.written[0] % np.uint64(2))
    row = to.slots[slot]
    begin = _HEAD
    for part in to.parts:
        for k in range(len(part)):
            row[begin + k] = part[k]
        begin += len(part)
    to.as_u64[slot, 0] = to.written[0]
    to.as_u64[slot, 1] = checksum(to.as_u32[slot])


@compiled
def checksum(slot: np.ndarray) -> int:
    """Return the FNV-1a hash, by numbers of 32 bits, of a slot without its checksum.

    Four hashes side by side, of every fourth number, and then theirs: a processor waits for each
    product of one. A slot of zeros has another one than 0.
    """
    a = b = c = d = _FNV_START
    whole = len(slot) - len(slot) % 4
    for k in range(4, whole, 4):
        a, b = _hashed(a, slot[k]), _hashed(b, slot[k + 1])
        c, d = _hashed(c, slot[k + 2]), _hashed(d, slot[k + 3])
    total = _hashed(_hashed(_FNV_START, slot[0]), slot[1])
    total = _hashed(_hashed(_hashed(_hashed(total, a), b), c), d)
    for k in range(whole, len(slot)):
        total = _hashed(total, slot[k])
    return total


@compiled
def _hashed(total: int, number: int) -> int:
    return ((total ^ int(number)) * _FNV_PRIME) & 0xFFFFFFFF


def map_array(path: Path, dtype: np.dtype, length: int) -> np.ndarray:
    """Return an array that is the content of a file, shared with whoever else maps it.

    A new file holds zeros. Its space is taken at once, so that a disk that fills up later does no
    harm.

    Raises:
        OSError: The file cannot be made; it is named.
    """
    size = max(length * dtype.itemsize, 1)
    with naming(path), path.open("a+b") as file:
        if os.fstat(file.fileno()).st_size != size:
            file.truncate(0)
            os.posix_fallocate(file.fileno(), 0, size)
        mapped = mmap.mmap(file.fileno(), size)
    return np.frombuffer(mapped, dtype, length)

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
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_defs.config.output_files import naming
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import bytes_of, copy_bytes

VEHICLE = np.dtype([("mode", "i8"), ("item", "i8"), ("acted", "i8")])
"""Of a vehicle, besides its compiled records: custom_mode, current mission item, bit per actuator
whose loss has acted."""

_HEAD = 16  # bytes of a slot before its content: count, checksum
_DIGEST = 64  # bytes of the file before the slots
_FNV_START, _FNV_PRIME = 0x811C9DC5, 0x01000193


class Checkpoint(NamedTuple):
    """The file of an autopilot; without slots nothing is saved."""

    slots: np.ndarray  # (2, size), bytes in the file
    as_u64: np.ndarray  # (2, size / 8), the same: count, checksum, the rest
    as_u32: np.ndarray  # (2, size / 4), the same
    written: np.ndarray  # (1,), how often a slot was written
    saved: np.ndarray  # (parts, 2), first byte and end of what is saved of the record


def no_checkpoint() -> Checkpoint:
    """Return a checkpoint that saves nothing."""
    return Checkpoint(
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 0), np.uint64),
        np.zeros((0, 0), np.uint32),
        np.zeros(1, np.uint64),
        np.zeros((0, 2), np.int64),
    )


def open_checkpoint(path: Path, saved: np.ndarray, edges: np.ndarray, described: str) -> Checkpoint:
    """Open the file of an autopilot, or make it; its space on the disk is taken at once.

    Args:
        path: The file.
        saved: First byte and end of each part of the autopilot's record that is saved.
        edges: Its edges, which are saved as well.
        described: A text that identifies configuration and record; a file of another one is
            cleared.

    Raises:
        OSError: The file cannot be made; it is named.
    """
    content_size = int((saved[:, 1] - saved[:, 0]).sum()) + edges.nbytes
    size = -(-(_HEAD + content_size) // 8) * 8
    digest = hashlib.sha512(f"{described}\n{saved.tolist()}\n{edges.dtype.descr}".encode()).digest()
    content = map_array(path, np.dtype(np.uint8), _DIGEST + 2 * size)
    if content[:_DIGEST].tobytes() != digest:
        content[:] = 0
        content[:_DIGEST] = np.frombuffer(digest, np.uint8)
    slots = content[_DIGEST:].reshape(2, size)
    as_u64 = slots.view(np.uint64)
    return Checkpoint(slots, as_u64, slots.view(np.uint32), as_u64[:, 0].max(keepdims=True), saved)


def restore(checkpoint: Checkpoint, own: np.ndarray, edges: np.ndarray) -> bool:
    """Restore what was saved of an autopilot; False if there is none.

    Args:
        checkpoint: Of `open_checkpoint`.
        own: Its record, shape (1,), written.
        edges: Its edges, shape (degree,), written.
    """
    for slot in np.argsort(checkpoint.as_u64[:, 0])[::-1]:
        count, hashed = checkpoint.as_u64[slot, :2]
        if count == 0 or hashed != checksum(checkpoint.as_u32[slot]):
            continue
        memory, begin = own.view(np.uint8), _HEAD
        for first, end in checkpoint.saved:
            memory[first:end] = checkpoint.slots[slot, begin : begin + end - first]
            begin += end - first
        edges.view(np.uint8)[:] = checkpoint.slots[slot, begin : begin + edges.nbytes]
        return True
    return False


@compiled
def save(to: Checkpoint, own: np.ndarray, edges: np.ndarray) -> None:
    """Write an autopilot into the slot whose turn it is; do nothing without a file.

    Args:
        to: The checkpoint.
        own: Its record, dtype `ftc_autopilot.hot.state.AUTOPILOT`, shape (1,).
        edges: Its edges, dtype `EDGE`, shape (1, degree).
    """
    if len(to.slots) == 0:
        return
    to.written[0] += np.uint64(1)
    slot = int(to.written[0] % np.uint64(2))
    row, memory, begin = to.slots[slot], bytes_of(own[0]), _HEAD
    for part in range(len(to.saved)):
        first, end = to.saved[part, 0], to.saved[part, 1]
        copy_bytes(row, begin, memory, first, end - first)
        begin += end - first
    for d in range(edges.shape[1]):
        memory = bytes_of(edges[0, d])
        copy_bytes(row, begin, memory, 0, len(memory))
        begin += len(memory)
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

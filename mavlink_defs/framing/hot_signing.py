"""Signatures of the hot path: `mavlink_defs.framing.signing` in compiled code.

A `Seal` without a key costs nothing: frames go out unsigned and are checked as by the codec.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import (
    FOREIGN,
    OUT_OF_RANGE,
    REPLAYED,
    SIGNED,
    UNSIGNED,
    WRONG_SIGNATURE,
    add_checksum,
    check,
    identify,
    new_buffer,
)
from mavlink_defs.framing.sha256 import signature
from mavlink_defs.framing.signing import (
    EPOCH_S,
    WINDOW,
    flagged,
    new_time,
    open_time,
    read_key,
)
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.native import unix_s

__all__ = ["Seal", "load_seal", "new_seal", "open_frame", "seal_bytes", "seal_frame"]

_RADIO_STATUS = dialect.MAVLINK_MSG_ID_RADIO_STATUS
_HASH = 6  # bytes, after link id (1) and timestamp (6)
_STAMP = 6


class Seal(NamedTuple):
    """What signs and checks the frames of one link."""

    key: np.ndarray  # (32,) uint8; (0,): no key
    link: int  # link id, in both directions
    time: np.ndarray  # (1,) timestamp used or seen last
    shared: np.ndarray  # (1,) the same of all processes
    newest: np.ndarray  # (65536,) last timestamp by 256 * system + component, 0: none yet


def new_seal(key: bytes, link: int, shared: np.ndarray | None = None) -> Seal:
    """A seal of one link.

    Args:
        key: 32 bytes, or none to have frames unsigned.
        link: Link id.
        shared: The timestamp used last, of `signing.open_time`.
    """
    return Seal(
        np.frombuffer(key, np.uint8).copy(),
        link,
        new_time(),
        new_time() if shared is None else shared,
        np.zeros(65536 if key else 0, np.int64),
    )


def load_seal(key_file: str | None, link: int) -> Seal:
    """The seal of a key file; without one, a seal that lets everything pass.

    Raises:
        SigningError: The key cannot be used.
    """
    if key_file is None:
        return new_seal(b"", link)
    return new_seal(read_key(key_file), link, open_time(key_file))


@compiled
def seal_frame(seal: Seal, datagram: np.ndarray, length: int) -> int:
    """Sign an unsigned hot frame in place, if there is a key.

    Args:
        seal: The seal.
        datagram: Buffer of `codec.new_buffer` with the frame.
        length: Its length [bytes].

    Returns:
        The new length [bytes].
    """
    if seal.key.size == 0:
        return length
    datagram[2] |= 1
    add_checksum(datagram)
    return _append(seal, datagram, length)


def seal_bytes(seal: Seal, frame: bytes) -> bytes:
    """Sign any unsigned frame that the dialect knows, if there is a key."""
    if seal.key.size == 0:
        return frame
    datagram = new_buffer()
    datagram[: len(frame)] = np.frombuffer(flagged(frame), np.uint8)
    return bytes(datagram[: _append(seal, datagram, len(frame))])


@compiled
def open_frame(seal: Seal, datagram: np.ndarray, length: int) -> int:
    """Tell what a received datagram holds, as `codec.check` does, signatures checked.

    With a key, FOREIGN means that the frame may be believed; SIGNED is never the answer.
    """
    code = check(datagram, length)
    if seal.key.size == 0:
        return code
    if code == SIGNED:
        return _verify(seal, datagram, length)
    if code == FOREIGN and datagram[7] == _RADIO_STATUS and datagram[8] == datagram[9] == 0:
        return FOREIGN
    return UNSIGNED if code >= FOREIGN else code


@compiled
def _verify(seal: Seal, datagram: np.ndarray, length: int) -> int:
    code = identify(datagram)
    if code < FOREIGN:
        return code
    given = 0
    for k in range(_HASH):
        given = (given << 8) | int(np.int64(datagram[length - _HASH + k]))
    if given != signature(seal.key, datagram, length - _HASH):
        return WRONG_SIGNATURE
    stamp = 0
    for k in range(_STAMP):
        stamp |= int(np.int64(datagram[length - _HASH - _STAMP + k])) << (8 * k)
    stream = 256 * np.int64(datagram[5]) + np.int64(datagram[6])
    newest, now = seal.newest[stream], _now(seal, 0)
    if newest == 0:
        newest = now - WINDOW - 1
    if datagram[length - _HASH - _STAMP - 1] != seal.link or stamp <= newest:
        return REPLAYED
    if stamp > now + WINDOW:
        return OUT_OF_RANGE
    seal.newest[stream] = stamp
    seal.time[0] = max(seal.time[0], stamp)
    return code


@compiled
def _append(seal: Seal, datagram: np.ndarray, length: int) -> int:
    stamp = _now(seal, 1)
    seal.time[0] = stamp
    seal.shared[0] = max(seal.shared[0], stamp)
    datagram[length] = seal.link
    for k in range(_STAMP):
        datagram[length + 1 + k] = (stamp >> (8 * k)) & 0xFF
    end = length + 1 + _STAMP
    given = signature(seal.key, datagram, end)
    for k in range(_HASH):
        datagram[end + k] = (given >> (8 * (_HASH - 1 - k))) & 0xFF
    return end + _HASH


@compiled
def _now(seal: Seal, more: int) -> int:
    """The timestamp to use now, after `more` than the last."""
    clock = int((unix_s() - EPOCH_S) * 1e5)
    return int(max(clock, max(seal.time[0], seal.shared[0]) + more))

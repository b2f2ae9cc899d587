"""Signatures of the hot path: `mavlink_defs.framing.signing` in compiled code.

A `LinkSigner` without a key costs nothing: frames go out unsigned and are checked as by the codec.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import (
    FOREIGN,
    SIGNED,
    add_checksum,
    check,
    identify,
    new_buffer,
)
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.header import COMPONENT, FLAGS, MESSAGE_ID, SIGNED_FLAG, SYSTEM
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

__all__ = [
    "LinkSigner",
    "load_link_signer",
    "new_link_signer",
    "sign_bytes",
    "sign_frame",
    "verify_frame",
]

_RADIO_STATUS = dialect.MAVLINK_MSG_ID_RADIO_STATUS
_HASH = 6  # bytes, after link id (1) and timestamp (6)
_STAMP = 6


class LinkSigner(NamedTuple):
    """Key and timestamps with which the frames of one link are signed and verified."""

    key: np.ndarray  # (32,) uint8; (0,): no key
    link: int  # link id, in both directions
    time: np.ndarray  # (1,) timestamp used or seen last
    shared: np.ndarray  # (1,) the same, shared by all processes
    newest: np.ndarray  # (65536,) last timestamp by 256 * system + component, 0: none yet


def new_link_signer(key: bytes, link: int, shared: np.ndarray | None = None) -> LinkSigner:
    """Return the signer of one link.

    Args:
        key: 32 bytes, or none to have frames unsigned.
        link: Link id.
        shared: The timestamp used last, of `signing.open_time`.
    """
    return LinkSigner(
        np.frombuffer(key, np.uint8).copy(),
        link,
        new_time(),
        new_time() if shared is None else shared,
        np.zeros(65536 if key else 0, np.int64),
    )


def load_link_signer(key_file: str | None, link: int) -> LinkSigner:
    """Return the signer of a key file; without a file, one that neither signs nor verifies.

    Raises:
        SigningError: The key cannot be used.
    """
    if key_file is None:
        return new_link_signer(b"", link)
    return new_link_signer(read_key(key_file), link, open_time(key_file))


@compiled
def sign_frame(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    """Sign an unsigned hot frame in place, if there is a key.

    Args:
        link_signer: The signer of the link.
        datagram: Buffer of `codec.new_buffer` with the frame.
        length: Its length [bytes].

    Returns:
        The new length [bytes].
    """
    if link_signer.key.size == 0:
        return length
    datagram[FLAGS] |= SIGNED_FLAG
    add_checksum(datagram)
    return append_signature(link_signer, datagram, length)


def sign_bytes(link_signer: LinkSigner, frame: bytes) -> bytes:
    """Sign any unsigned frame that the dialect knows, if there is a key."""
    if link_signer.key.size == 0:
        return frame
    datagram = new_buffer()
    datagram[: len(frame)] = np.frombuffer(flagged(frame), np.uint8)
    return bytes(datagram[: append_signature(link_signer, datagram, len(frame))])


@compiled
def verify_frame(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    """Classify a received datagram, as `codec.check` does, and verify its signature.

    With a key, FOREIGN means that the signature is valid; SIGNED is never returned.
    """
    code = check(datagram, length)
    if link_signer.key.size == 0:
        return code
    if code == SIGNED:
        return _verify(link_signer, datagram, length)
    if code == FOREIGN and _is_radio_status(datagram):
        return FOREIGN
    return DropReason.UNSIGNED if code >= FOREIGN else code


@compiled
def _is_radio_status(datagram: np.ndarray) -> bool:
    high = datagram[MESSAGE_ID + 1] | datagram[MESSAGE_ID + 2]
    return bool(datagram[MESSAGE_ID] == _RADIO_STATUS and high == 0)


@compiled
def _verify(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    code = identify(datagram)
    if code < FOREIGN:
        return code
    given = 0
    for k in range(_HASH):
        given = (given << 8) | int(np.int64(datagram[length - _HASH + k]))
    if given != signature(link_signer.key, datagram, length - _HASH):
        return DropReason.WRONG_SIGNATURE
    stamp = 0
    for k in range(_STAMP):
        stamp |= int(np.int64(datagram[length - _HASH - _STAMP + k])) << (8 * k)
    stream = 256 * np.int64(datagram[SYSTEM]) + np.int64(datagram[COMPONENT])
    newest, now = link_signer.newest[stream], _now(link_signer, 0)
    if newest == 0:
        newest = now - WINDOW - 1
    if datagram[length - _HASH - _STAMP - 1] != link_signer.link or stamp <= newest:
        return DropReason.REPLAYED
    if stamp > now + WINDOW:
        return DropReason.OUT_OF_RANGE
    link_signer.newest[stream] = stamp
    link_signer.time[0] = max(link_signer.time[0], stamp)
    return code


@compiled
def append_signature(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    stamp = _now(link_signer, 1)
    link_signer.time[0] = stamp
    link_signer.shared[0] = max(link_signer.shared[0], stamp)
    datagram[length] = link_signer.link
    for k in range(_STAMP):
        datagram[length + 1 + k] = (stamp >> (8 * k)) & 0xFF
    end = length + 1 + _STAMP
    given = signature(link_signer.key, datagram, end)
    for k in range(_HASH):
        datagram[end + k] = (given >> (8 * (_HASH - 1 - k))) & 0xFF
    return end + _HASH


@compiled
def _now(link_signer: LinkSigner, more: int) -> int:
    """Return the timestamp to use now, after `more` than the last."""
    clock = int((unix_s() - EPOCH_S) * 1e5)
    return int(max(clock, max(link_signer.time[0], link_signer.shared[0]) + more))

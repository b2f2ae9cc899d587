"""Signatures of the hot path: `mavlink_defs.framing.signing` in compiled code.

A `LinkSigner` without a key costs nothing: frames go out unsigned and are checked as by the codec.
"""

import time
from typing import Any, NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import FOREIGN, SIGNED, add_checksum, check, identify, new_buffer
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.header import COMPONENT, FLAGS, MESSAGE_ID, SIGNED_FLAG, SYSTEM
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.sha256 import signature
from mavlink_defs.framing.signing import EPOCH_S, WINDOW, Keys, flagged, new_time, open_time
from mavlink_defs.runtime.jit import apart, compiled
from mavlink_defs.runtime.native import unix_s

_RADIO_STATUS = dialect.MAVLINK_MSG_ID_RADIO_STATUS
_HASH = 6  # bytes, after link id (1) and timestamp (6)
_STAMP = 6


SIGNER = np.dtype(
    [
        ("signs", "i8"),  # 1: there is a key
        ("key", "u1", (32,)),  # that frames are signed with
        ("replaced", "i8"),  # 1: `other` is a key
        ("other", "u1", (32,)),  # accepted, too
        ("link", "i8"),  # link id, in both directions
        ("time", "i8"),  # timestamp used or seen last
        ("start", "i8"),  # the same when it was made: what is not newer is from before
    ]
)
"""Keys and time of one link."""


class LinkSigner(NamedTuple):
    """What the frames of one link are signed and verified with."""

    state: np.void  # record of dtype SIGNER
    shared: np.ndarray  # (1,) timestamp used or seen last by all processes
    newest: np.ndarray  # (65536,) last timestamp by 256 * system + component, 0: none yet


def new_link_signer(
    keys: Keys | bytes, link: int, shared: "memoryview[int] | None" = None
) -> LinkSigner:
    """Return the signer of one link.

    Args:
        keys: 32 bytes, or none to have frames unsigned; or two keys in force.
        link: Link id.
        shared: The timestamp used or seen last, of `signing.open_time`.
    """
    if isinstance(keys, bytes):
        keys = Keys(keys, b"")
    signer = LinkSigner(
        np.zeros(1, SIGNER)[0],
        np.frombuffer(new_time() if shared is None else shared, np.int64),
        np.zeros(65536 if keys.signing else 0, np.int64),
    )
    signer.state["link"] = link
    signer.state["signs"] = bool(keys.signing)
    signer.state["start"] = 0 if shared is None else shared[0]
    use_keys(signer, keys)
    return signer


def use_keys(link_signer: LinkSigner, keys: Keys) -> None:
    """Replace the keys of a signer; timestamps stay."""
    state = link_signer.state
    if keys.signing:
        state["key"] = np.frombuffer(keys.signing, np.uint8)
    state["replaced"] = bool(keys.other)
    if keys.other:
        state["other"] = np.frombuffer(keys.other, np.uint8)


def load_link_signer(key_file: KeyFile | None, link: int) -> LinkSigner:
    """Return the compiled signer of a link; without a file, one that neither signs nor verifies.

    Raises:
        SigningError: The time of the last signature cannot be kept.
    """
    if key_file is None:
        return new_link_signer(b"", link)
    signer = new_link_signer(key_file.at(time.time()), link, open_time(key_file.path))
    signer.state["start"] = key_file.begin
    return signer


def refresh(key_file: KeyFile, *link_signers: LinkSigner) -> None:
    """Let compiled signers use the keys that a file holds now."""
    for link_signer in link_signers:
        use_keys(link_signer, key_file.at(time.time()))


_EXAMPLES: Any = {"link_signer": new_link_signer(b"", 0), "datagram": new_buffer()}


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
    if link_signer.state["signs"] == 0:
        return length
    datagram[FLAGS] |= SIGNED_FLAG
    add_checksum(datagram)
    return append_signature(link_signer, datagram, length)


def sign_bytes(link_signer: LinkSigner, frame: bytes) -> bytes:
    """Sign any unsigned frame that the dialect knows, if there is a key."""
    if link_signer.state["signs"] == 0:
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
    if link_signer.state["signs"] == 0:
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


@apart(**_EXAMPLES)
def _verify(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    code = identify(datagram)
    if code < FOREIGN:
        return code
    given = 0
    for k in range(_HASH):
        given = (given << 8) | int(np.int64(datagram[length - _HASH + k]))
    if given != signature(link_signer.state["key"], datagram, length - _HASH) and (
        link_signer.state["replaced"] == 0
        or given != signature(link_signer.state["other"], datagram, length - _HASH)
    ):
        return DropReason.WRONG_SIGNATURE
    stamp = 0
    for k in range(_STAMP):
        stamp |= int(np.int64(datagram[length - _HASH - _STAMP + k])) << (8 * k)
    stream = 256 * np.int64(datagram[SYSTEM]) + np.int64(datagram[COMPONENT])
    newest, now = link_signer.newest[stream], _now(link_signer, 0)
    if newest == 0:
        newest = max(now - WINDOW - 1, link_signer.state["start"])
    if datagram[length - _HASH - _STAMP - 1] != link_signer.state["link"] or stamp <= newest:
        return DropReason.REPLAYED
    if stamp > now + WINDOW:
        return DropReason.OUT_OF_RANGE
    link_signer.newest[stream] = stamp
    _note(link_signer, max(link_signer.state["time"], stamp))
    return code


@compiled
def _note(link_signer: LinkSigner, stamp: int) -> None:
    link_signer.state["time"] = stamp
    link_signer.shared[0] = max(link_signer.shared[0], stamp)


@apart(**_EXAMPLES)
def append_signature(link_signer: LinkSigner, datagram: np.ndarray, length: int) -> int:
    """Append the signature to the frame of so many bytes; the length with it."""
    stamp = _now(link_signer, 1)
    _note(link_signer, stamp)
    datagram[length] = link_signer.state["link"]
    for k in range(_STAMP):
        datagram[length + 1 + k] = (stamp >> (8 * k)) & 0xFF
    end = length + 1 + _STAMP
    given = signature(link_signer.state["key"], datagram, end)
    for k in range(_HASH):
        datagram[end + k] = (given >> (8 * (_HASH - 1 - k))) & 0xFF
    return end + _HASH


SIGNING_PARTS = (_verify, append_signature)
"""What links with a key use beyond what all use."""


@compiled
def _now(link_signer: LinkSigner, more: int) -> int:
    """Return the timestamp to use now, after `more` than the last."""
    clock = int((unix_s() - EPOCH_S) * 1e5)
    return int(max(clock, max(link_signer.state["time"], link_signer.shared[0]) + more))

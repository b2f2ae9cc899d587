"""MAVLink 2 signing: the key file, the clock of signatures, and the signer of one link.

https://mavlink.io/en/guide/message_signing.html. A signature covers the key, the frame and a
timestamp, in units of 10 µs since 2015, which no stream (system, component, link id) may use
twice. `Signer` is for frames that are not hot; `mavlink_defs.framing.hot_signing` does the same in
compiled code.
"""

import hashlib
import mmap
import os
import secrets
import stat
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx

from mavlink_defs import dialect
from mavlink_defs.config.user_files import open_file
from mavlink_defs.framing import header
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import frame_size

KEY_SIZE = 32  # bytes
EPOCH_S = 1_420_070_400  # 2015-01-01, Unix time
WINDOW = 6_000_000
"""Furthest that a new stream may be behind the own timestamp, or any frame ahead: one minute.

As both limits are equal, no frame can advance the own time so far that others fall behind it."""
PLANT_LINK, FORMATION_LINK = 254, 253
"""Link ids of the links that are not ground stations': what is captured on one link is refused
on the others."""
UNSIGNED_ALLOWED = frozenset({dialect.MAVLINK_MSG_ID_RADIO_STATUS})
"""Messages accepted unsigned: radios send them, and have no key."""

_HASH = 6  # bytes
_PRIVATE = 0o600


class SigningError(Exception):
    """A key cannot be used; the message names the file and what to do, never the key."""


def make_key(path: Path, key: bytes | None = None) -> None:
    """Write a key file that only its owner can read.

    Args:
        path: Must not exist.
        key: 32 bytes; None for random ones.

    Raises:
        SigningError: The file exists or cannot be written.
    """
    try:
        write_key(path, secrets.token_bytes(KEY_SIZE) if key is None else key)
        former_file(path).unlink(missing_ok=True)  # of another key of this name
    except FileExistsError:
        raise key_exists(path) from None
    except OSError as problem:
        raise SigningError(f"{path}: cannot be written: {problem.strerror}") from None


def key_exists(path: Path) -> SigningError:
    """Return the error of a new key whose file exists."""
    return SigningError(f"{path} exists already; only --replace overwrites a key")


def write_key(path: Path, key: bytes) -> None:
    """Write a new file that only its owner can read.

    Raises:
        OSError: It exists or cannot be written; then there is none.
    """
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _PRIVATE)
    try:
        with os.fdopen(fd, "wb") as file:
            file.write(key)
    except OSError:
        path.unlink()
        raise


def read_key(path: Path | str) -> bytes:
    """Read a key file.

    Raises:
        SigningError: It cannot be read, others can read it, or it holds no key.
    """
    try:
        with open_file(path) as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            key = file.read(KEY_SIZE + 1)
    except OSError as problem:
        hint = "; `gcs key FILE` makes one" if isinstance(problem, FileNotFoundError) else ""
        raise SigningError(f"signing key {path}: {problem.strerror}{hint}") from None
    if mode & 0o077:
        raise SigningError(
            f"signing key {path}: others can use it, its mode is {mode:04o}, expected 0600; "
            f"run: chmod 600 {path}"
        )
    if len(key) != KEY_SIZE or not any(key):
        size = "more" if len(key) > KEY_SIZE else "zeros" if len(key) == KEY_SIZE else len(key)
        raise SigningError(f"signing key {path}: expected {KEY_SIZE} bytes, got {size}")
    return key


def time_file(path: Path | str) -> str:
    """Return the name of the file beside a key that keeps the timestamp used last."""
    return f"{path}.time"


def former_file(path: Path | str) -> Path:
    """Return the name of the file beside a key that keeps the one before it."""
    return Path(f"{path}.former")


def timestamp(unix_s: float) -> int:
    """Return the timestamp of a signature [10 µs since 2015] at a Unix time [s]."""
    return int((unix_s - EPOCH_S) * 1e5)


def is_ahead(stamp: int) -> bool:
    """Return whether a timestamp is further ahead of the clock than it may be."""
    return stamp > timestamp(time.time()) + WINDOW


def new_time() -> "memoryview[int]":
    """Keep the timestamp used last in memory only, as one int64."""
    return memoryview(bytearray(8)).cast("q")


def open_time(path: Path | str) -> "memoryview[int]":
    """Keep the timestamp used last beside a key file, so that a restart does not go behind it.

    The file is mapped: all processes of this machine share it, each signature costs one store
    to memory, the writes of a killed process are kept, and the system saves them to disk at times.

    Returns:
        One int64, sharing the file's memory.

    Raises:
        SigningError: It cannot be written.
    """
    name = time_file(path)
    try:
        fd = os.open(name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, _PRIVATE)
        try:
            if os.fstat(fd).st_size < 8:
                os.ftruncate(fd, 8)
            return memoryview(mmap.mmap(fd, 8)).cast("q")
        finally:
            os.close(fd)
    except OSError as problem:
        text = f"signing: cannot keep the time of the last signature in {name}"
        raise SigningError(f"{text}: {problem.strerror}") from None


def flagged(frame: bytes) -> bytearray:
    """Return a frame of the dialect ready for its signature: flag set, checksum updated."""
    body = bytearray(frame[: -header.CRC_SIZE])
    body[header.FLAGS] |= header.SIGNED_FLAG
    message_id = int.from_bytes(body[header.MESSAGE_ID : header.HEADER_SIZE], "little")
    extra = dialect.mavlink_map[message_id].crc_extra
    return body + mcrf4xx(bytes(body[1:]) + bytes([extra])).to_bytes(header.CRC_SIZE, "little")


class Keys(NamedTuple):
    """Keys in force while one replaces the other."""

    signing: bytes  # 32 bytes, that frames are signed with
    other: bytes  # 32 bytes, accepted, too; empty: none


class Signer:
    """Signs and checks the frames of one link.

    Attributes:
        refused: Number of frames refused, by reason.
    """

    def __init__(
        self,
        key: bytes | Callable[[float], Keys],
        shared: "memoryview[int] | None" = None,
        link: int = 0,
        unix_s: Callable[[], float] = time.time,
        at_least: int = 0,
    ) -> None:
        """Make a signer.

        Args:
            key: 32 bytes; or what returns the keys in force at a Unix time [s].
            shared: The timestamp used or seen last, of `open_time`: what is not newer than it was
                at the start is from before.
            link: Link id to sign with.
            unix_s: The clock.
            at_least: Timestamp to begin with, if the clock does not show a later one.
        """
        self.refused: Counter[DropReason] = Counter()
        self._keys = key if callable(key) else lambda _: Keys(key, b"")
        self._link, self._unix_s = link, unix_s
        self._shared = new_time() if shared is None else shared
        self._start = self._shared[0]
        self._time = at_least
        self._newest: dict[tuple[int, int, int], int] = {}

    def __repr__(self) -> str:
        return f"Signer(link={self._link})"  # never the key

    def sign(self, frame: bytes) -> bytes:
        """Return the signed frame of an unsigned one that the dialect knows."""
        body = flagged(frame)
        self._note(self._now(1))
        body.append(self._link)
        body += self._time.to_bytes(6, "little")
        return bytes(body + _hash(self._keys(self._unix_s()).signing, body))

    def accepts(self, frame: bytes) -> bool:
        """Return whether a frame's signature is valid; if not, the reason is counted."""
        wrong = self.problem(frame)
        if wrong is not None:
            self.refused[wrong] += 1
        return wrong is None

    def problem(self, frame: bytes) -> DropReason | None:
        """Return why a frame is refused; None if its signature is valid."""
        size, wrong = frame_size(frame)
        if wrong is not None:
            return wrong
        if size != len(frame):
            return DropReason.BAD_LENGTH
        if not frame[header.FLAGS] & header.SIGNED_FLAG:
            message_id = int.from_bytes(frame[header.MESSAGE_ID : header.HEADER_SIZE], "little")
            allowed = message_id in UNSIGNED_ALLOWED
            return None if allowed else DropReason.UNSIGNED
        link = frame[-header.SIGNATURE_SIZE]
        keys = self._keys(self._unix_s())
        if not any(
            key and secrets.compare_digest(_hash(key, frame[:-_HASH]), frame[-_HASH:])
            for key in keys
        ):
            return DropReason.WRONG_SIGNATURE
        stamp = int.from_bytes(frame[-header.SIGNATURE_SIZE + 1 : -_HASH], "little")
        stream, now = (link, frame[header.SYSTEM], frame[header.COMPONENT]), self._now()
        newest = self._newest.get(stream, max(now - WINDOW - 1, self._start))
        if stamp <= newest or link in {PLANT_LINK, FORMATION_LINK} - {self._link}:
            return DropReason.REPLAYED
        if stamp > now + WINDOW:
            return DropReason.OUT_OF_RANGE
        self._newest[stream] = stamp
        self._note(max(self._time, stamp))
        return None

    def _note(self, stamp: int) -> None:
        self._time = stamp
        self._shared[0] = max(self._shared[0], stamp)

    def _now(self, more: int = 0) -> int:
        """Return the timestamp to use now, after `more` than the last."""
        clock = timestamp(self._unix_s())
        return max(self._time + more, self._shared[0] + more, clock)


def _hash(key: bytes, covered: bytes | bytearray) -> bytes:
    return hashlib.sha256(key + covered).digest()[:_HASH]


def counts_text(refused: Counter[str]) -> str:
    """Return a text of how many frames were refused for which reasons."""
    return ", ".join(f"{count} {reason}" for reason, count in sorted(refused.items()))

"""A key file that may be replaced while processes use it.

Every process polls the file itself; nothing about keys crosses a link. The age of the file
tells all of them which key to sign with: for `ANNOUNCED_S` the former one, so that everybody has
seen the new one before it is used; then the new one. Both are accepted until `GRACE_S`. The former
key is in a second file beside it, for processes that start meanwhile.
"""

import os
import secrets
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from mavlink_defs.framing import signing

ANNOUNCED_S = 10.0
"""Age up to which a new key is accepted but not used to sign [s]."""
GRACE_S = 30.0
"""Age up to which the former key is accepted [s]."""

_POLL_S = 0.5


def replace_key(path: Path, key: bytes | None = None) -> None:
    """Replace the key in a file; processes that use it take the new one over.

    Args:
        path: The key file.
        key: 32 bytes; None for random ones.

    Raises:
        SigningError: There is no key to be replaced, it was replaced a moment ago, or the new one
            cannot be written; the key then stays.
    """
    former, keys = signing.read_key(path), KeyFile(path)
    if keys.at(time.time()).other:
        raise signing.SigningError(
            f"{path}: was replaced less than {GRACE_S:g} s ago; the key before that one is still "
            "accepted; wait"
        )
    new = path.with_name(f"{path.name}.new")
    try:
        for place, content in (
            (signing.former_file(path), former),
            (path, key or secrets.token_bytes(signing.KEY_SIZE)),
        ):
            new.unlink(missing_ok=True)
            signing.write_key(new, content)
            new.replace(place)
    except OSError as problem:
        raise signing.SigningError(f"{path}: cannot be replaced: {problem.strerror}") from None


class _Version(NamedTuple):
    """What a file held when it was read."""

    since_s: float  # Unix time
    key: bytes
    former: bytes


class KeyFile:
    """The keys of a file, as it is now.

    If it cannot be read any more, the keys read last stay valid, and the reason is reported once.

    Attributes:
        path: The file.
        begin: Timestamp used last, by any process, when this was made; 0 if there was none. What is
            not newer was not meant for a process that makes this before binding a port.
    """

    def __init__(
        self, path: Path | str, on_problem: Callable[[str], None] = lambda _: None
    ) -> None:
        """Read the file.

        Raises:
            SigningError: It holds no key that can be used.
        """
        self.path, self._on_problem = Path(path), on_problem
        self.begin = _last_time(path)
        self._problem = ""
        self._seen = self._stamp()
        self._version = self._read()
        self._checked_s = 0.0

    def at(self, unix_s: float) -> signing.Keys:
        """Return the keys to use at a Unix time [s], which is about now."""
        if abs(unix_s - self._checked_s) >= _POLL_S:
            self._checked_s = unix_s
            self._check()
        age_s, version = unix_s - self._version.since_s, self._version
        if not version.former or age_s >= GRACE_S:
            return signing.Keys(version.key, b"")
        if age_s >= ANNOUNCED_S:
            return signing.Keys(version.key, version.former)
        return signing.Keys(version.former, version.key)

    def _check(self) -> None:
        try:
            stamp = self._stamp()
            if stamp == self._seen:
                return
            self._version = self._read()
            self._seen = stamp
        except signing.SigningError as problem:
            if str(problem) != self._problem:
                self._problem = str(problem)
                self._on_problem(f"{problem}; the key read before stays in force")

    def _stamp(self) -> tuple[int, int]:
        try:
            state = os.stat(self.path)
        except OSError as problem:
            hint = "; `gcs key FILE` makes one" if isinstance(problem, FileNotFoundError) else ""
            text = f"signing key {self.path}: {problem.strerror}{hint}"
            raise signing.SigningError(text) from None
        return state.st_ino, state.st_mtime_ns

    def _read(self) -> _Version:
        since_s = self.path.stat().st_mtime
        key, former = signing.read_key(self.path), signing.former_file(self.path)
        return _Version(since_s, key, signing.read_key(former) if former.exists() else b"")


def load_signer(key_file: str | None) -> signing.Signer | None:
    """Return the signer of a key file for a ground station link; None without one.

    Raises:
        SigningError: The key cannot be used.
    """
    if key_file is None:
        return None
    return signing.Signer(KeyFile(key_file).at, signing.open_time(key_file))


def _last_time(key_file: Path | str) -> int:
    """Return what `open_time` keeps beside a key file, 0 if it keeps nothing yet."""
    try:
        return int.from_bytes(Path(signing.time_file(key_file)).read_bytes(), sys.byteorder)
    except OSError:
        return 0

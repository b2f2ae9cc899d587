"""Reading files that a user names, of any kind and size, without waiting and without end."""

import os
import stat
from pathlib import Path

from mavlink_defs.config.problems import ConfigError, Problem

__all__ = ["LARGEST_FILE", "read_text"]

LARGEST_FILE = 1_000_000
"""Most bytes of a scenario, campaign, profile or mission file."""

_KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
}


def read_text(path: Path | str) -> str:
    """Return the text of a regular file in UTF-8.

    Raises:
        ConfigError: It is no regular file, is larger than `LARGEST_FILE`, is no text, or cannot be
            read.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe without a writer blocks
        with open(descriptor, "rb") as file:
            mode = os.fstat(descriptor).st_mode
            if not stat.S_ISREG(mode):
                raise ConfigError(path, [Problem((), f"expected a file, got {_kind(mode)}")])
            data = file.read(LARGEST_FILE + 1)
    except FileNotFoundError as exc:
        raise ConfigError(path, [Problem((), "no such file")]) from exc
    except OSError as exc:
        what = _kind_of(path)
        text = f"expected a file, got {what}" if what else f"cannot be read: {exc.strerror}"
        raise ConfigError(path, [Problem((), text)]) from exc
    if len(data) > LARGEST_FILE:
        text = f"expected at most {LARGEST_FILE / 1e6:g} MB, got more"
        raise ConfigError(path, [Problem((), text)])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        problem = f"not UTF-8 text: byte {exc.start} is 0x{exc.object[exc.start]:02x}"
        raise ConfigError(path, [Problem((), problem)]) from exc


def _kind(mode: int) -> str:
    return next((name for is_one, name in _KINDS.items() if is_one(mode)), "")


def _kind_of(path: Path | str) -> str:
    """Return what else than a file has a path; "" if that is unknown."""
    try:
        return _kind(os.stat(path).st_mode)
    except OSError:
        return ""

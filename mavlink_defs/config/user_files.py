"""Reading files that a user names, of any kind and size, without waiting and without end."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from mavlink_defs.config.problems import ConfigError, Problem

MAX_FILE = 1_000_000
"""Most bytes of a scenario, campaign, profile or mission file."""

_KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
}


class NotAFileError(OSError):
    """There is a folder, a pipe, a socket or a device instead of a file; `strerror` says so."""


def open_file(path: Path | str) -> BinaryIO:
    """Open a regular file to read it; anything else is refused without waiting for it.

    Raises:
        OSError: It cannot be read.
        NotAFileError: It is something else.
    """
    if what := _kind_of(path):
        raise NotAFileError(errno.EINVAL, f"expected a file, got {what}", str(path))
    return open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))


def read_text(path: Path | str) -> str:
    """Return the text of a regular file in UTF-8.

    Raises:
        ConfigError: It is no regular file, is larger than `MAX_FILE`, is no text, or cannot be
            read.
    """
    try:
        with open_file(path) as file:
            data = file.read(MAX_FILE + 1)
    except FileNotFoundError as exc:
        raise ConfigError(path, [Problem((), "no such file")]) from exc
    except NotAFileError as exc:
        raise ConfigError(path, [Problem((), str(exc.strerror))]) from exc
    except OSError as exc:
        raise ConfigError(path, [Problem((), f"cannot be read: {exc.strerror}")]) from exc
    if len(data) > MAX_FILE:
        text = f"expected at most {MAX_FILE / 1e6:g} MB, got more"
        raise ConfigError(path, [Problem((), text)])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        problem = f"not UTF-8 text: byte {exc.start} is 0x{exc.object[exc.start]:02x}"
        raise ConfigError(path, [Problem((), problem)]) from exc


def _kind_of(path: Path | str) -> str:
    """Return what else than a file has a path; "" if that is unknown."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return ""
    return next((name for is_one, name in _KINDS.items() if is_one(mode)), "")

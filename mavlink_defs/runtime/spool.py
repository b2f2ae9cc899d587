"""The recording of a process on disk: .npy files that a reader may take away meanwhile.

A file's name is the number of its first row; the reader takes the lowest first.

Each is there as a whole or not at all, so that a process that is killed loses only what it had not
written yet. When the process ends, `end.json` says how; without it the recording is torn.
"""

import functools
import io
import json
import mmap
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from mavlink_defs.config.output_files import complete_file, naming, write_text

_END = "end.json"
_HEAD = 10  # bytes of a .npy file up to its header: magic string, version 1.0, length of the header


class Spool:
    """The writer's side."""

    def __init__(self, folder: Path, resume: bool = False) -> None:
        """Make the folder, empty, or continue in the existing one.

        Raises:
            OSError: It cannot be made; it is named.
        """
        self._folder = folder
        if not resume:
            self.restart()

    def restart(self) -> None:
        """Forget everything written."""
        with naming(self._folder):
            if self._folder.exists():
                shutil.rmtree(self._folder)
            self._folder.mkdir(parents=True)

    def write(self, first: int, rows: np.ndarray) -> None:
        """Write the next rows, the first of which has this number.

        Raises:
            OSError: With the file's name.
        """
        header = _header_of(rows.dtype, len(rows))
        with complete_file(self._folder / f"{first:010d}.npy") as file:
            file.write(header)  # NumPy's errors of writing to a file do not say what is wrong
            file.write(rows.view(np.uint8).data)

    def finish(self, **facts: Any) -> None:
        """Write what is known at the end, as JSON.

        Raises:
            OSError: With the file's name.
        """
        write_text(self._folder / _END, json.dumps(facts))


@functools.lru_cache
def _header_of(dtype: np.dtype, rows: int) -> bytes:
    """Return what precedes the rows in an .npy file."""
    file, none = io.BytesIO(), np.empty(0, dtype)
    facts = np.lib.format.header_data_from_array_1_0(none) | {"shape": (rows,)}
    np.lib.format.write_array_header_1_0(file, facts)
    return file.getvalue()


@functools.cache
def _dtype_of(header: bytes) -> np.dtype:
    """Return the type in the header of a .npy file; reading that takes as long as all its rows."""
    file = io.BytesIO(header)
    np.lib.format.read_magic(file)
    dtype: np.dtype = np.lib.format.read_array_header_1_0(file)[2]
    return dtype


class SpoolReader:
    """The reader's side."""

    def __init__(self, folder: Path) -> None:
        """Read from a folder, which need not exist yet."""
        self._folder = folder

    def take(self) -> tuple[int, np.ndarray] | None:
        """Return the next rows and the number of the first; None if there are none yet.

        Their file is removed. The rows are read-only, the file's pages in memory, and keep a file
        descriptor while they are in use.
        """
        path = min(self._folder.glob("*.npy"), default=None)
        if path is None:
            return None
        try:
            with path.open("rb") as file:
                content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            path.unlink()
        except FileNotFoundError:  # the writer begins again
            return None
        begin = _HEAD + int.from_bytes(content[_HEAD - 2 : _HEAD], "little")
        return int(path.stem), np.frombuffer(content, _dtype_of(content[:begin]), offset=begin)

    def discard(self) -> None:
        """Remove all that has been written and not taken."""
        for path in self._folder.glob("*.npy"):
            path.unlink(missing_ok=True)

    @property
    def waiting(self) -> int:
        """How many pieces have been written and not taken."""
        return sum(1 for _ in self._folder.glob("*.npy"))

    @property
    def facts(self) -> dict[str, Any] | None:
        """What the process wrote at its end; None if it did not come to that."""
        try:
            facts: dict[str, Any] = json.loads((self._folder / _END).read_text())
        except (FileNotFoundError, ValueError):
            return None
        return facts

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self._folder, ignore_errors=True)


def unwritten(problem: Exception) -> str:
    """Return why something cannot be recorded, for the user."""
    if isinstance(problem, OSError) and problem.filename:
        return f"cannot write {problem.filename}: {problem.strerror}"
    return f"a defect of ftc-sitl: {type(problem).__name__}: {problem}"

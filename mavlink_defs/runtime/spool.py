"""The recording of a process on disk: numbered .npy files that a reader may take away meanwhile.

Each is there as a whole or not at all, so that a process that is killed loses only what it had not
written yet. When the process ends, `end.json` says how; without it the recording is torn.
"""

import io
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from mavlink_defs.runtime.files import complete_file, naming, write_text

__all__ = ["Spool", "SpoolReader"]

_END = "end.json"


class Spool:
    """The writer's side."""

    def __init__(self, folder: Path) -> None:
        """Make the folder, empty.

        Raises:
            OSError: It cannot be made; it is named.
        """
        self._folder = folder
        self.restart()

    def restart(self) -> None:
        """Forget everything written."""
        with naming(self._folder):
            if self._folder.exists():
                shutil.rmtree(self._folder)
            self._folder.mkdir(parents=True)
        self._count = 0

    def write(self, rows: np.ndarray) -> None:
        """Write the next rows.

        Raises:
            OSError: With the file's name.
        """
        content = io.BytesIO()  # NumPy's errors of writing to a file do not say what is wrong
        np.save(content, rows)
        with complete_file(_path(self._folder, self._count)) as file:
            file.write(content.getbuffer())
        self._count += 1

    def finish(self, **facts: Any) -> None:
        """Write what is known at the end, as JSON.

        Raises:
            OSError: With the file's name.
        """
        write_text(self._folder / _END, json.dumps(facts))


class SpoolReader:
    """The reader's side."""

    def __init__(self, folder: Path) -> None:
        """Read from a folder, which need not exist yet."""
        self._folder = folder
        self._count = 0

    def take(self) -> np.ndarray | None:
        """Return the next rows and remove their file; None if there is none yet."""
        path = _path(self._folder, self._count)
        try:
            rows: np.ndarray = np.load(path)
        except FileNotFoundError:
            return None
        path.unlink()
        self._count += 1
        return rows

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


def _path(folder: Path, number: int) -> Path:
    return folder / f"{number:06d}.npy"

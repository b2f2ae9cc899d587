"""Writing files: an error names the file, and one can be there as a whole or not at all."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO


@contextlib.contextmanager
def naming(path: Path | str) -> Iterator[None]:
    """Name a file in the error of writing it; a full disk's has no name.

    Raises:
        OSError: As within the context, with a file name.
    """
    try:
        yield
    except OSError as problem:
        raise named(problem, path) from None


def named(problem: OSError, path: Path | str) -> OSError:
    """Return an error with a file's name, unless it has one."""
    if problem.filename is not None:
        return problem
    return OSError(problem.errno, problem.strerror, str(path))


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, as `complete_file` does."""
    with complete_file(path) as file:
        file.write(text.encode())


@contextlib.contextmanager
def complete_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file to write; the name appears when the file is complete.

    What is no file but a device, a pipe or a link to something is written as it is.

    Raises:
        OSError: With the file's name; nothing is left of the file, and one before it stays.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        with naming(path), path.open("wb") as file:
            yield file
        return
    part = path.with_name(f"{path.name}.part")
    try:
        with naming(path), part.open("wb") as file:
            yield file
        part.replace(path)
    except BaseException as problem:
        with contextlib.suppress(OSError):
            part.unlink()
        if isinstance(problem, OSError) and problem.filename == str(part):
            raise OSError(problem.errno, problem.strerror, str(path)) from None
        raise


def save_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write arrays as .npz, as `complete_file` does."""
    import numpy as np  # here, as commands that only talk to vehicles write no arrays

    with complete_file(path) as file:
        np.savez(file, **arrays)

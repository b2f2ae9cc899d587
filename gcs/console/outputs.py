"""Files and folders that a command writes where its user says: whole, or none is left."""

import contextlib
from collections.abc import Iterable, Iterator
from itertools import takewhile
from pathlib import Path

from gcs.console.errors import BadInput
from mavlink_defs.config.output_files import write_text

_made: list[Path] = []


def make_folder(folder: Path, what: str = "--out") -> Path:
    """Make a folder, and those above it; `remove_empty` removes them.

    Args:
        folder: The folder, which may be there.
        what: The option that names it, for messages.

    Raises:
        BadInput: It cannot be made.
    """
    check_folder(folder, what)
    _made.extend(takewhile(lambda one: not one.exists(), (folder, *folder.parents)))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        text = f"cannot make the folder {folder}: {problem.strerror}"
        raise BadInput(text, f"choose another with {what}") from problem
    return folder


def check_folder(folder: Path, what: str = "--out") -> None:
    """Refuse a name that no folder can have, before a command works for it.

    Raises:
        BadInput: A file is there, or where a folder of it would be.
    """
    _refuse_file_above(folder, what)
    if folder.is_file():
        raise BadInput(f"{what} is {folder}, a file, expected a folder", "choose another")


def check_file(path: Path, what: str = "--out") -> None:
    """Refuse a name that no file can have, before a command works for it.

    Raises:
        BadInput: A folder is there, or a file is where a folder of it would be.
    """
    if path.is_dir():
        text = f"{what} is {path}, a folder, expected a file"
        raise BadInput(text, "name a file in it, or another one")
    _refuse_file_above(path, what)


def write_file(path: Path, text: str, what: str = "--out") -> None:
    """Write a text file, and make its folders.

    Raises:
        BadInput: It cannot be there.
        OSError: It cannot be written; it is named.
    """
    check_file(path, what)
    make_folder(path.parent, what)
    write_text(path, text)


@contextlib.contextmanager
def all_or_none(paths: Iterable[Path]) -> Iterator[None]:
    """Remove the files among some that are new if one of them cannot be written."""
    new = [path for path in paths if not path.exists()]
    try:
        yield
    except BaseException:
        for path in new:
            with contextlib.suppress(OSError):
                path.unlink()
        raise


def remove_empty() -> None:
    """Remove the folders that were made here and are empty: a command has failed."""
    for folder in sorted(_made, key=lambda one: -len(one.parts)):
        with contextlib.suppress(OSError):
            folder.rmdir()
    _made.clear()


def _refuse_file_above(path: Path, what: str) -> None:
    for above in path.parents:
        if above.exists() and not above.is_dir():
            raise BadInput(f"{what} is {path}, but {above} is a file", "choose another")

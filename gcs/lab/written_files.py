"""Files that `gcs identify` and `gcs design` write: each replaces its own, and no other."""

from pathlib import Path

from gcs.errors import BadInput
from mavlink_defs.config.output_files import write_text
from mavlink_defs.config.user_files import read_text


def check_out(path: Path | None, mark: str, made: str) -> None:
    """Refuse to replace a file that a command has not written, before it has worked for minutes.

    Args:
        path: The file; None: none is written.
        mark: First words of what the command writes.
        made: What a file of the command is, for messages.

    Raises:
        BadInput: Another file is there, or no folder to write it to.
    """
    if path is None:
        return
    if path.is_dir():
        raise BadInput(f"--out is {path}, a folder, expected a file", f"as in {path / 'mine.yaml'}")
    if not path.parent.is_dir():
        raise BadInput(f"cannot write {path}: {path.parent} is no folder", "make it first")
    if path.is_file() and not read_text(path).startswith(mark):
        text = f"{path} already exists, is not {made}, and was not changed"
        raise BadInput(text, "choose another --out, or remove it")


def write_out(path: Path, text: str) -> None:
    """Write a file as a whole, or not at all.

    Raises:
        BadInput: It cannot be written.
    """
    try:
        write_text(path, text)
    except OSError as problem:
        raise BadInput(f"cannot write {path}: {problem.strerror}") from problem

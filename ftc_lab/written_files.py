"""Files that `gcs identify` and `gcs design` write: each replaces its own, and no other."""

from pathlib import Path

from gcs.console.errors import BadInput
from gcs.console.outputs import check_file
from mavlink_defs.config.user_files import read_text


def check_out(path: Path | None, mark: str, made: str) -> None:
    """Refuse to replace a file that a command has not written, before it has worked for minutes.

    Args:
        path: The file; None: none is written.
        mark: How a file of the command begins.
        made: What a file of the command is, for messages.

    Raises:
        BadInput: Another file is there, or no file can be.
    """
    if path is None:
        return
    check_file(path)
    if path.is_file() and not read_text(path).startswith(mark):
        text = f"{path} already exists, is not {made}, and was not changed"
        raise BadInput(text, "choose another --out, or remove it")

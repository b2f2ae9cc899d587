"""Files that commands of the lab write: each replaces its own, and no other; and pictures."""

from pathlib import Path
from typing import TYPE_CHECKING

from gcs.console.errors import BadInput
from gcs.console.outputs import check_file, make_folder
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.config.user_files import read_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PICTURES = (".png", ".svg", ".pdf")


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


def check_picture(output: Path | None) -> None:
    """Refuse a name that is none of a picture, or where no file can be; None: none is written."""
    if output is None:
        return
    check_file(output, "--out")
    if output.suffix not in _PICTURES:
        raise BadInput(f"--out is {output}, expected a name that ends in {' or '.join(_PICTURES)}")


def save_picture(output: Path, figure: "Figure") -> None:
    """Write a picture whose name was checked; BadInput if it cannot be written."""
    make_folder(output.parent, "--out")
    try:
        with complete_file(output) as file:
            figure.savefig(file, format=output.suffix[1:])
    except OSError as problem:  # whose status would be as of a fault that is found
        text = f"cannot write {output}: {problem.strerror}"
        raise BadInput(text, "choose another with --out") from None

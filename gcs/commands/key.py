"""``gcs key``: make a key for signing."""

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from gcs.errors import BadInput
from mavlink_defs.framing.signing import SigningError, make_key

__all__ = ["EPILOG", "key"]

EPILOG = """
Examples:

- gcs key ~/.fleet.key
- gcs key ~/.fleet.key --passphrase    (asks for it; the same key as MAVProxy's signing commands)

Then `signing_key: PATH` in the links section of a scenario, or `--signing-key PATH`.

Exit status: 0 written, 2 bad input.
"""


def key(
    file: Annotated[Path, typer.Argument(help="New file.", metavar="FILE")],
    passphrase: Annotated[
        bool, typer.Option("--passphrase", help="Derive it from a passphrase instead of at random.")
    ] = False,
) -> None:
    """Make a key file for MAVLink 2 signing: 32 bytes that only you can read."""
    content = None
    if passphrase:
        text = typer.prompt("Passphrase", hide_input=True, confirmation_prompt=True, err=True)
        content = hashlib.sha256(text.encode()).digest()
    try:
        make_key(file, content)
    except SigningError as problem:
        raise BadInput(str(problem)) from None
    typer.echo(f"key written to {file}")

"""``gcs key``: make a key for signing, or replace one while the fleet flies."""

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from gcs.console.errors import BadInput, Interrupted
from gcs.console.lines import print_line
from mavlink_defs.framing.key_file import ANNOUNCED_S, GRACE_S, replace_key
from mavlink_defs.framing.signing import SigningError, key_exists, make_key, read_key


def key(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    passphrase: Annotated[bool, typer.Option("--passphrase")] = False,
    replace: Annotated[bool, typer.Option("--replace")] = False,
) -> None:
    """Make a key file for MAVLink 2 signing.

    It has 32 bytes that only you can read. With --replace, whatever uses the file goes over to the
    new key by itself.

    Args:
        file: Key file: a new one, or with --replace the one in use.
        passphrase: Derive the key from a passphrase instead of drawing it at random.
        replace: Replace the key of a file that is in use.

    Examples:
        - gcs key ~/.fleet.key
        - gcs key ~/.fleet.key --replace       (a new key in the same file, also in flight)
        - gcs key ~/.fleet.key --passphrase    (asks for it; the same key as MAVProxy's signing
          commands)

    Then `signing_key: PATH` in the links section of a scenario, or `--signing-key PATH`.

    Exit status: 0 written, 2 bad input, 130 Ctrl-C.
    """
    try:
        if replace:
            read_key(file)
        elif file.exists():
            raise key_exists(file)
        content = _derived_key() if passphrase else None
        if replace:
            replace_key(file, content)
        else:
            make_key(file, content)
    except SigningError as problem:
        raise BadInput(str(problem)) from None
    if replace:
        print_line(
            f"key replaced in {file}: in use from {ANNOUNCED_S:g} s on, "
            f"the former one accepted until {GRACE_S:g} s"
        )
    else:
        print_line(f"key written to {file}")


def _derived_key() -> bytes:
    """Ask for a passphrase, and return the 32 bytes that it gives.

    Raises:
        BadInput: There was nobody to ask.
        Interrupted: Ctrl-C.
    """
    try:
        text = typer.prompt("Passphrase", hide_input=True, confirmation_prompt=True, err=True)
    except typer.Abort as problem:
        if isinstance(problem.__context__, KeyboardInterrupt):
            raise Interrupted("interrupted") from None
        raise BadInput("no passphrase was given", "type it twice, or feed it in twice") from None
    return hashlib.sha256(text.encode()).digest()

"""The command line: ``gcs``."""

import os
import sys

import typer

from gcs.commands import fly, wire, wireshark
from gcs.errors import BadInput, GcsError, Interrupted
from mavlink_defs.config import ConfigError

__all__ = ["app", "main"]

_EXIT_DEFECT = 70

app = typer.Typer(
    help="Ground station of ftc-sitl: fly a UAV formation over real MAVLink.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


@app.callback()
def gcs() -> None:
    """Ground station of ftc-sitl: fly a UAV formation over real MAVLink."""


app.command(epilog=fly.EPILOG)(fly.fly)
app.command(epilog=wire.EPILOG)(wire.wire)
app.command(epilog=wireshark.EPILOG)(wireshark.wireshark)


def main() -> None:
    """Run the command line; turn exceptions into one plain message and an exit status."""
    try:
        app()
    except ConfigError as problem:
        _complain(str(problem))
        sys.exit(BadInput.exit_status)
    except GcsError as problem:
        prefix = "" if isinstance(problem, Interrupted) else "error: "
        _complain(f"{prefix}{problem}", problem.hint)
        sys.exit(problem.exit_status)
    except BrokenPipeError:  # the reader of our output has gone: nothing left to say
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as defect:
        if os.environ.get("FTC_SITL_DEBUG"):
            raise
        _complain(
            f"error: this is a defect of ftc-sitl: {type(defect).__name__}: {defect}",
            "run again with FTC_SITL_DEBUG=1 for a traceback, and report it",
        )
        sys.exit(_EXIT_DEFECT)


def _complain(text: str, hint: str = "") -> None:
    print(text, file=sys.stderr)
    if hint:
        print(f"hint: {hint}", file=sys.stderr)

"""The command line: ``gcs``."""

import os
import sys

import typer

from gcs.commands import (
    control,
    dashboard,
    fault,
    fly,
    key,
    log,
    param,
    profile,
    record,
    reproduce,
    status,
    sweep,
    up,
    wire,
    wireshark,
)
from gcs.commands.station import ConnectOption
from gcs.errors import BadInput, GcsError, Interrupted
from gcs.signing import keyed
from mavlink_defs.config import ConfigError

__all__ = ["app", "main"]

_EXIT_DEFECT = 70

app = typer.Typer(
    help="Ground station of ftc-sitl: fly a UAV formation over real MAVLink.",
    invoke_without_command=True,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


@app.callback(epilog=dashboard.EPILOG)
def gcs(
    context: typer.Context,
    connect: ConnectOption = None,
    theme: dashboard.ThemeOption = "dark",
) -> None:
    """Ground station of ftc-sitl: fly a UAV formation over real MAVLink.

    Without a command: the operator's dashboard.
    """
    if context.invoked_subcommand is not None:
        dashboard.refuse_options(context)
    elif dashboard.has_terminal():
        dashboard.dashboard(connect, theme)
    else:
        typer.echo(context.get_help())


app.command(epilog=fly.EPILOG)(keyed(fly.fly))
app.command(epilog=reproduce.EPILOG)(reproduce.reproduce)
app.command(epilog=sweep.EPILOG)(sweep.sweep)
app.command(epilog=up.EPILOG)(keyed(up.up))
app.command(epilog=status.EPILOG)(keyed(status.status))
app.command(epilog=control.START_EPILOG)(keyed(control.start))
app.command(epilog=control.ARM_EPILOG)(keyed(control.arm))
app.command(epilog=control.DISARM_EPILOG)(keyed(control.disarm))
app.command(epilog=control.MODE_EPILOG)(keyed(control.mode))
app.add_typer(fault.app, name="fault")
app.add_typer(profile.app, name="profile")
app.add_typer(param.app, name="param")
app.command(epilog=record.EPILOG)(keyed(record.record))
app.command(epilog=log.EPILOG)(log.log)
app.command(epilog=key.EPILOG)(key.key)
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

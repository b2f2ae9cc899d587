"""The command line: ``gcs``."""

import contextlib
import errno
import gc
import os
import resource
import sys
from typing import Annotated, Any, NoReturn

import typer

from gcs.commands import (
    baseline,
    campaign,
    compare,
    config,
    control,
    dashboard,
    export,
    fault,
    fly,
    formation,
    key,
    log,
    mission,
    new,
    param,
    profile,
    record,
    reproduce,
    scenarios,
    status,
    sweep,
    trim,
    up,
    wire,
    wireshark,
)
from gcs.commands.station import ConnectOption
from gcs.errors import BadInput, GcsError, Interrupted
from gcs.stopping import stop_as_ctrl_c
from gcs.terminal import print_line
from mavlink_defs.config.models import ConfigError

__all__ = ["app", "main"]

_EXIT_CTRL_C = 130  # of typer
_EXIT_DEFECT = 70
_NOT_WRITABLE = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EROFS,
    errno.EACCES,
    errno.EPERM,
    errno.EIO,
}
_SPACE = "free some space, or choose a writable folder; files written so far are kept"

app = typer.Typer(
    invoke_without_command=True,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


def _show_versions(wanted: bool) -> None:
    if wanted:
        import platform
        from importlib.metadata import version

        print_line(f"ftc-sitl {version('ftc-sitl')}\nPython {platform.python_version()}")
        for package in ("pymavlink", "numba"):
            print_line(f"{package} {version(package)}")
        raise typer.Exit


@app.callback(epilog=dashboard.EPILOG)
def gcs(
    context: typer.Context,
    connect: ConnectOption = None,
    theme: dashboard.ThemeOption = "dark",
    _version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_show_versions,
            is_eager=True,
            help="Print the versions of ftc-sitl, Python, pymavlink and numba.",
        ),
    ] = False,
) -> None:
    """Ground station of ftc-sitl: fly a UAV formation over real MAVLink.

    Without a command: the operator's dashboard.
    """
    if context.invoked_subcommand is not None:
        dashboard.refuse_options(context)
    elif dashboard.has_terminal():
        dashboard.dashboard(connect, theme)
    else:
        context.get_help()  # prints it


app.command(epilog=fly.EPILOG)(fly.fly)
app.command(epilog=export.EPILOG)(export.export)
app.command(epilog=reproduce.EPILOG)(reproduce.reproduce)
app.command(epilog=compare.EPILOG)(compare.compare)
app.command(epilog=sweep.EPILOG)(sweep.sweep)
app.command(epilog=baseline.EPILOG)(baseline.baseline)
app.command(epilog=campaign.EPILOG)(campaign.campaign)
app.command(epilog=trim.EPILOG)(trim.trim)
app.command(epilog=scenarios.EPILOG)(scenarios.scenarios)
app.command(epilog=new.EPILOG)(new.new)
app.command(epilog=up.EPILOG)(up.up)
app.command(epilog=config.EPILOG)(config.config)
app.command(epilog=status.EPILOG)(status.status)
app.command(epilog=control.START_EPILOG)(control.start)
app.command(epilog=control.ARM_EPILOG)(control.arm)
app.command(epilog=control.DISARM_EPILOG)(control.disarm)
app.command(epilog=control.MODE_EPILOG)(control.mode)
app.add_typer(fault.app, name="fault")
app.add_typer(formation.app, name="formation")
app.add_typer(profile.app, name="profile")
app.add_typer(mission.app, name="mission")
app.add_typer(param.app, name="param")
app.command(epilog=record.EPILOG)(record.record)
app.command(epilog=log.EPILOG)(log.log)
app.command(epilog=key.EPILOG)(key.key)
app.command(epilog=wire.EPILOG)(wire.wire)
app.command(epilog=wireshark.EPILOG)(wireshark.wireshark)


def _command() -> Any:
    """Return the command line, whose help texts show no type beside flags: they take no value."""
    command = typer.main.get_command(app)
    commands: list[Any] = [command]
    while commands:
        one = commands.pop()
        commands += getattr(one, "commands", {}).values()
        for parameter in one.get_params(typer.Context(one)):
            if getattr(parameter, "is_flag", False):
                parameter.metavar = ""
    return command


def main() -> None:
    """Run the command line; turn exceptions into one plain message and an exit status."""
    stop_as_ctrl_c()
    gc.freeze()  # what is imported stays: to look for garbage there takes up to a tenth of a second
    try:
        try:
            status = _command()(standalone_mode=False)
        finally:
            sys.stdout.flush()  # here and not at exit, where an error could not be reported
    except ConfigError as problem:
        _end(BadInput.exit_status, str(problem))
    except Interrupted as problem:
        _end(problem.exit_status, str(problem), problem.hint)
    except GcsError as problem:
        _end(problem.exit_status, f"error: {problem}", problem.hint)
    except typer.TyperException as problem:
        _end_usage(problem)
    except typer.Abort:
        _end(GcsError.exit_status, "error: aborted")
    except BrokenPipeError:  # the reader of our output has ended: nothing to report
        _close_output()
    except Exception as problem:
        if os.environ.get("FTC_SITL_DEBUG"):
            raise
        if isinstance(problem, OSError) and problem.errno in {errno.EMFILE, errno.ENFILE}:
            limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
            text = f"error: too many files and sockets are open; the limit is {limit}"
            _end(GcsError.exit_status, text, "raise it, as in `ulimit -n 1024`")
        if isinstance(problem, OSError) and problem.errno in _NOT_WRITABLE:
            if problem.filename is None:
                _close_output()
            what = problem.filename or "the standard output"
            _end(GcsError.exit_status, f"error: cannot write {what}: {problem.strerror}", _SPACE)
        _end(
            _EXIT_DEFECT,
            f"error: this is a defect of ftc-sitl: {type(problem).__name__}: {problem}",
            "run again with FTC_SITL_DEBUG=1 for a traceback, and report it",
        )
    if status == _EXIT_CTRL_C:  # before the command could handle it
        _end(Interrupted.exit_status, "interrupted")
    sys.exit(status)


def _end_usage(problem: Any) -> NoReturn:
    """End with a mistake of the command line; without arguments, a group has printed its help."""
    if not (text := problem.format_message()):
        sys.exit(problem.exit_code)
    context = getattr(problem, "ctx", None)
    hint = "" if context is None else f"see `{context.command_path} --help`"
    _end(problem.exit_code, f"error: {text}", hint)


def _end(status: int, text: str, hint: str = "") -> NoReturn:
    with contextlib.suppress(OSError):  # the terminal may be gone
        print_line(text, stderr=True)
        if hint:
            print_line(f"hint: {hint}", stderr=True)
    sys.exit(status)


def _close_output() -> None:
    """Discard buffered output: at exit it would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

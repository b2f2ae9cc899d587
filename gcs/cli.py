"""The command line: ``gcs``."""

import contextlib
import errno
import gc
import os
import resource
import sys
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from gcs.commands.options import ConnectOption, ThemeOption
from gcs.errors import BadInput, GcsError, Interrupted
from gcs.extras import LAB_PACKAGES, WEB_PACKAGES, load_lab, missing
from gcs.outputs import remove_empty
from gcs.stopping import ending_at_once, stop_as_ctrl_c
from gcs.terminal import print_line
from mavlink_defs.config.problems import ConfigError
from mavlink_defs.runtime.foreign import PluginError

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
_MISPLACED = {errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR, errno.EISDIR}
_SPACE = "free some space, or choose a writable folder; files written so far stay"

COMMANDS = {
    "fly": ("fly", "Fly a scenario to its end and record it."),
    "ardupilot": (
        "ardupilot",
        "Let ArduPilot SITLs fly a scenario's aircraft, with its faults, servos, wind and sensors.",
    ),
    "runs": ("runs", "List what was flown, write a page of it, and add notes."),
    "export": (
        "export",
        "Convert the recording of a flight, light or full, to a format of other programs.",
    ),
    "reproduce": (
        "reproduce",
        "Fly the paper's scenarios and compare the results with its tables and figures.",
    ),
    "compare": (
        "compare",
        "Test whether a campaign is worse than another one, or show how two flights differ.",
    ),
    "sweep": ("sweep", "Fly every combination of values, in process, on all cores."),
    "baseline": (
        "baseline",
        "Find the slowest periodic senders that are as good as a triggered flight.",
    ),
    "campaign": (
        "campaign",
        "Fly every draw of a campaign, in process, on all cores or on a cluster.",
    ),
    "trim": (
        "trim",
        "Compute where an actuator may be stuck so that level flight remains possible.",
    ),
    "aircraft": (
        "aircraft",
        "List the bundled aircraft, or show one: size, limits, trim, modes, authority.",
    ),
    "design": ("design", "Write a scenario for an aircraft, every parameter derived from it."),
    "identify": (
        "identify",
        "Identify the nominal aircraft of a simulator, or of a recorded flight.",
    ),
    "scenarios": (
        "scenarios",
        "List the bundled scenarios, one per line: name and what it shows; then the additions.",
    ),
    "laws": ("laws", "List the control laws, ours and other packages', or show one."),
    "triggers": (
        "triggers",
        "List the event triggers, ours and other packages', or show one.",
    ),
    "guidance": (
        "guidance",
        "List the guidance laws, ours and other packages', or show one.",
    ),
    "new": (
        "new",
        "Write a small commented scenario, or a whole project, as a starting point for your own.",
    ),
    "up": ("up", "Start a fleet that flies until it is stopped (Ctrl-C)."),
    "config": (
        "config",
        "Write the configuration of each process of a fleet that spans several hosts.",
    ),
    "status": (
        "status",
        "Show link, mode, attitude, events, savings and faults of every vehicle.",
    ),
    "start": (
        "control",
        "Start flying the mission: at once in flight, else when simulated time begins.",
    ),
    "arm": (
        "control",
        "Arm vehicles. Simulated time begins when every vehicle of the fleet is armed.",
    ),
    "disarm": ("control", "Disarm vehicles; in flight they refuse unless forced."),
    "mode": (
        "control",
        "Change the mode: fly the mission, circle here, circle at home, or follow targets.",
    ),
    "record": ("record", "Record every frame that vehicles send, with its time, until Ctrl-C."),
    "log": ("log", "Replay a telemetry log in the dashboard, with seek and speed."),
    "web": (
        "web",
        "Serve the dashboard to browsers until Ctrl-C, read-only unless --control is given.",
    ),
    "key": ("key", "Make a key file for MAVLink 2 signing: 32 bytes that only you can read."),
    "wire": ("wire", "Count frames and bytes per link, sender, message and actuator channel."),
    "wireshark": (
        "wireshark",
        "Write a Wireshark dissector for all messages of the dialect (Lua, 3 MB).",
    ),
    "fault": ("fault", "Set, clear and list faults of actuators and sensors."),
    "formation": ("formation", "See the formation in space, and change slots."),
    "profile": ("profile", "Upload, download and check reference profiles."),
    "mission": ("mission", "Show, upload, download and fly missions."),
    "param": ("param", "List, read, set, save, load and compare parameters."),
}
"""Module and one line of help of each command, in the order of the help.

It is the first line of the command's own help, which is not imported for the help of `gcs`.
"""

_LAB = {
    *("aircraft", "baseline", "campaign", "compare", "design", "identify"),
    *("reproduce", "sweep", "trim"),
}
"""Commands of `gcs.lab`."""
_EXTRAS = {
    **dict.fromkeys(("baseline", "campaign", "reproduce", "sweep"), ("lab", LAB_PACKAGES)),
    "web": ("web", WEB_PACKAGES),
}
"""Commands that need an extra: its name, and the packages that they import."""

_EPILOG = """
Examples:

- gcs                                  (the dashboard, with the fleet of `gcs up`)
- gcs --connect udpin:0.0.0.0:14550    (the dashboard, as the only ground station)
- gcs log flight.tlog                  (the dashboard, with a log)
"""


class _Commands(TyperGroup):
    """The commands, each imported when it is run; until then only its line of help is there.

    What only talks to vehicles therefore neither imports nor waits for what flies them.
    """

    def __init__(self, **attributes: Any) -> None:
        lines = {name: TyperCommand(name, short_help=line) for name, (_, line) in COMMANDS.items()}
        super().__init__(**{**attributes, "commands": lines})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in COMMANDS:
            self.load(args[0])
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show the help, which marks what lacks an extra."""
        for name, (extra, packages) in _EXTRAS.items():
            if missing(packages):
                line = COMMANDS[name][1]
                self.commands[name].short_help = f"{line} Needs the extra `{extra}`."
        super().format_help(ctx, formatter)

    def load(self, name: str) -> None:
        """Import a command."""
        module, _ = COMMANDS[name]
        with ending_at_once():
            home: Any = (
                load_lab(f"commands.{module}", f"gcs {name}" if name in _EXTRAS else None)
                if name in _LAB
                else import_module(f"gcs.commands.{module}")
            )
        gc.freeze()  # what is imported stays: to search it for garbage takes a tenth of a second
        holder = typer.Typer(rich_markup_mode="markdown")
        if hasattr(home, name) and not hasattr(home, "app"):
            epilog = getattr(home, f"{name.upper()}_EPILOG", None) or home.EPILOG
            holder.command(name, epilog=epilog)(getattr(home, name))
        else:
            holder.add_typer(home.app, name=name)
        self.commands[name] = _without_types(typer.main.get_group(holder).commands[name])


app = typer.Typer(
    cls=_Commands,
    invoke_without_command=True,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


def _show_versions(asked: bool) -> None:
    if asked:
        import platform
        from importlib.metadata import version

        print_line(f"ftc-sitl {version('ftc-sitl')}\nPython {platform.python_version()}")
        for package in ("pymavlink", "numba"):
            print_line(f"{package} {version(package)}")
        raise typer.Exit


@app.callback(epilog=_EPILOG)
def gcs(
    context: typer.Context,
    connect: ConnectOption = None,
    theme: ThemeOption = "dark",
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
        _refuse_options(context)
        return
    with ending_at_once():
        from gcs.commands import dashboard
    if dashboard.has_terminal():
        dashboard.dashboard(connect, theme)
    else:
        context.get_help()  # prints it


def _refuse_options(context: typer.Context) -> None:
    """Refuse options of the dashboard that precede a command: they would be ignored.

    Raises:
        BadInput: There are some.
    """
    for name in ("connect", "theme"):
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            command = context.invoked_subcommand
            raise BadInput(
                f"--{name} before `{command}` is for the dashboard",
                f"put options after the command: gcs {command} --{name} ...",
            )


def _without_types(command: Any) -> Any:
    """Return a command whose help texts show no types: flags take no value, the others say what.

    Options and arguments have names of values, such as FILE or DEG, or show their choices.
    """
    commands: list[Any] = [command]
    while commands:
        one = commands.pop()
        commands += getattr(one, "commands", {}).values()
        for parameter in one.get_params(typer.Context(one)):
            if getattr(parameter, "is_flag", False):
                parameter.metavar = ""
            elif parameter.param_type_name == "argument":
                parameter.display_type_rich = _nothing
            elif parameter.type_descriptor.is_choice:
                parameter.metavar = parameter.metavar or "|".join(parameter.type_descriptor.choices)
    return command


def _nothing(*, ctx: typer.Context) -> None:
    pass


def whole_command() -> Any:
    """Return the command line with all commands imported, as its reference needs it."""
    command = typer.main.get_group(app)
    assert isinstance(command, _Commands)
    for name in COMMANDS:
        command.load(name)
    return _without_types(command)


def main() -> None:
    """Run the command line; turn exceptions into one plain message and an exit status."""
    try:
        stop_as_ctrl_c()
        try:
            status = _without_types(typer.main.get_command(app))(standalone_mode=False)
        finally:
            sys.stdout.flush()  # here and not at exit, where an error could not be reported
    except ConfigError as problem:
        _end(BadInput.exit_status, str(problem))
    except PluginError as problem:
        _end(BadInput.exit_status, f"error: {problem}")
    except Interrupted as problem:
        _end(problem.exit_status, str(problem), problem.hint)
    except GcsError as problem:
        _end(problem.exit_status, f"error: {problem}", problem.hint)
    except typer.TyperException as problem:
        _end_usage(problem)
    except typer.Abort:
        _end(GcsError.exit_status, "error: aborted")
    except KeyboardInterrupt:  # before typer, which turns it into a status, has it
        _end(Interrupted.exit_status, "interrupted")
    except BrokenPipeError:  # the reader of our output has ended: nothing to report
        _close_output()
    except Exception as problem:
        if os.environ.get("FTC_SITL_DEBUG"):
            raise
        if isinstance(problem, OSError) and problem.errno in {errno.EMFILE, errno.ENFILE}:
            limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
            text = f"error: too many files and sockets are open; the limit is {limit}"
            _end(GcsError.exit_status, text, "raise it, as in `ulimit -n 1024`")
        if isinstance(problem, OSError) and problem.errno in _MISPLACED and problem.filename:
            _end(BadInput.exit_status, f"error: {problem.filename}: {problem.strerror}")
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
    if status:
        remove_empty()
    sys.exit(status)


_EXPECTED = {  # pydantic's type of an error: what an option or argument expects
    "float_parsing": "a number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "greater_than_equal": "at least {ge}",
    "less_than_equal": "at most {le}",
}


def _end_usage(problem: Any) -> NoReturn:
    """End with a mistake of the command line; without arguments, a group has printed its help."""
    if not (text := _wrong_value(problem) or problem.format_message()):
        sys.exit(problem.exit_code)
    context = getattr(problem, "ctx", None)
    hint = "" if context is None else f"see `{context.command_path} --help`"
    _end(problem.exit_code, f"error: {text}", hint)


def _wrong_value(problem: Any) -> str:
    """Return which option has which value, and what it expects; "" if that is not the mistake."""
    if not hasattr(problem.__cause__, "errors"):
        return ""
    error = problem.__cause__.errors()[0]  # of pydantic
    name = problem.param.get_error_hint().replace("'", "")
    if error["type"] == "value_error":
        return f"{name}: {error['ctx']['error']}"
    if (expected := _EXPECTED.get(error["type"])) is None:
        return ""
    return f"{name}: expected {expected.format(**error.get('ctx', {}))}, got {error['input']!r}"


def _end(status: int, text: str, hint: str = "") -> NoReturn:
    remove_empty()
    with contextlib.suppress(OSError):  # the terminal may be gone
        print_line(text, stderr=True)
        if hint:
            print_line(f"hint: {hint}", stderr=True)
    sys.exit(status)


def _close_output() -> None:
    """Discard buffered output: at exit it would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

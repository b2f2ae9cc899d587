"""The command line: ``gcs``."""

import contextlib
import errno
import gc
import math
import os
import resource
import sys
import warnings
from functools import partial
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from gcs.command_list import GONE, OWN, GcsCommand, command_of, load, registered
from gcs.commands.options import ConnectOption, ThemeOption
from gcs.console.errors import BadInput, GcsError, Interrupted
from gcs.console.extras import missing
from gcs.console.lines import print_line
from gcs.console.outputs import remove_empty
from gcs.console.stopping import ending_at_once, stop_as_ctrl_c
from mavlink_defs.config.problems import ConfigError
from mavlink_defs.config.renamed import RenamedWarning
from mavlink_defs.docstrings import texts_of
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
_WARNED: set[str] = set()
_PYTHONS_LINE = warnings.formatwarning
_SPACE = "free some space, or choose a writable folder; files written so far stay"


class _Commands(TyperGroup):
    """The commands, each imported when it is run; until then only its line of help is there.

    What only talks to vehicles therefore neither imports nor waits for what flies them. Other
    packages are asked for theirs when a command is not one of ours, and for the help.
    """

    def __init__(self, **attributes: Any) -> None:
        lines = {name: _line(name, command) for name, command in OWN.items()}
        super().__init__(**{**attributes, "commands": lines})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0] if args else ""
        if name in GONE:
            raise BadInput(f"there is no gcs {name} any more", f"use {GONE[name]}")
        if name in OWN:
            self.load(name, OWN[name])
        elif point := registered().get(name):
            self.load(name, command_of(point))
        else:
            self.list_commands(ctx)  # for the suggestions
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands, by panel."""
        for name, point in registered().items():
            try:
                self.commands[name] = _line(name, command_of(point))
            except BadInput as problem:
                self.commands[name] = _line(name, GcsCommand("", f"{problem}."))
        panels = list(dict.fromkeys(command.panel for command in OWN.values()))
        order = {name: k for k, name in enumerate(panels)}
        shown: Any = self.commands
        return sorted(shown, key=lambda name: order.get(shown[name].rich_help_panel, len(panels)))

    def load_all(self) -> None:
        """Import all commands."""
        others = {name: command_of(point) for name, point in registered().items()}
        for name, command in {**OWN, **others}.items():
            self.load(name, command)

    def load(self, name: str, command: GcsCommand) -> None:
        """Import a command."""
        with ending_at_once():
            home: Any = load(name, command)
        gc.freeze()  # what is imported stays: to search it for garbage takes a tenth of a second
        holder = typer.Typer(rich_markup_mode="markdown")
        function = getattr(home, name.replace("-", "_"), None)
        if function is not None and not hasattr(home, "app"):
            holder.command(name, epilog=getattr(home, "EPILOG", None))(function)
        else:
            holder.add_typer(home.app, name=name)
        self.commands[name] = _without_types(typer.main.get_group(holder).commands[name])


def _line(name: str, command: GcsCommand) -> Any:
    """Return what stands for a command in the help of `gcs`."""
    lacks = command.extra and missing(command.packages)
    needs = f" Needs the extra `{command.extra}`." if lacks else ""
    return TyperCommand(name, short_help=command.line + needs, rich_help_panel=command.panel)


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
        from importlib.metadata import PackageNotFoundError, version

        print_line(f"ftc-sitl {version('ftc-sitl')}\nPython {platform.python_version()}")
        for package in ("pymavlink", "numba"):
            try:
                print_line(f"{package} {version(package)}")
            except PackageNotFoundError:  # no flight needs it
                print_line(f"{package} is not installed")
        raise typer.Exit


@app.callback()
def gcs(
    context: typer.Context,
    connect: ConnectOption = None,
    theme: ThemeOption = "dark",
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_versions, is_eager=True)
    ] = False,
) -> None:
    """Ground station of ftc-sitl: fly a UAV formation over real MAVLink.

    Without a command: the operator's dashboard.

    Args:
        _version: Print the versions of ftc-sitl and what it stands on.

    Examples:
        - gcs --connect udpin:0.0.0.0:14550    (as the only ground station)
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
    """Return a command with our help, which has no types: flags take no value, others say what.

    Options and arguments have names of values, such as FILE or DEG, or show their choices.
    """
    commands: list[Any] = [command]
    while commands:
        one = commands.pop()
        commands += getattr(one, "commands", {}).values()
        one.format_help = _format_help.__get__(one)
        about, examples, rest = (one.help or "").partition("\n\nExamples:\n")
        if examples:  # they follow the options
            one.epilog = "Examples:\n\n" + rest.replace("\n    ", "\n").removeprefix("    ")
        one.help, texts = about.partition("\n\nArgs:\n")[0], texts_of(about, "Args")
        for parameter in one.get_params(typer.Context(one)):
            parameter.help = texts.get(parameter.name, parameter.help)
            parameter.process_value = partial(_processed, parameter)
            if getattr(parameter, "is_flag", False):
                parameter.metavar = ""
            elif parameter.param_type_name == "argument":
                parameter.display_type_rich = _nothing
            elif parameter.type_descriptor.is_choice:
                parameter.metavar = parameter.metavar or "|".join(parameter.type_descriptor.choices)
    return command


def _processed(parameter: Any, ctx: typer.Context, value: Any) -> Any:
    """Process the value of a parameter as typer does, which takes NaN and infinity for numbers.

    Typer has pydantic for it, whose import takes as long as all else that a short command imports:
    what has the right type, or is a plain number, does without.

    Raises:
        BadInput: It is one of these.
    """
    if "float" in str(parameter.type_descriptor.annotation):
        _check_finite(parameter, value)
    plain, is_many = _plain(parameter, value), parameter.multiple or parameter.nargs != 1
    if plain is None and (is_many or parameter.required or value is not None):
        return type(parameter).process_value(parameter, ctx, value)
    return plain if parameter.callback is None else parameter.callback(ctx, parameter, plain)


def _plain(parameter: Any, value: Any) -> Any:
    """Return a value that needs no conversion of typer's; None if it does, or is none."""
    how = parameter.type_descriptor
    kind, is_text = how.annotation, isinstance(value, str)
    texts = [choice for choice in how.choices or () if type(choice) is str]  # no enumerations
    if how.is_path or how.parameter_info.parser:
        return None
    if type(value) is kind or (is_text and value in texts):
        return value
    if kind is float and is_text and value.replace(".", "", 1).isdigit() and value.isascii():
        least, most = parameter.min, parameter.max
        number = float(value)
        return number if (least or 0.0) <= number <= (math.inf if most is None else most) else None
    return None


def _check_finite(parameter: Any, value: Any) -> None:
    for text in value if isinstance(value, list | tuple) else (value,):
        with contextlib.suppress(TypeError, ValueError):
            if not math.isfinite(float(text)):
                least, most = parameter.min, parameter.max
                bounds = [f"at least {least:g}"] if least is not None else []
                bounds += [f"at most {most:g}"] if most is not None else []
                expected = " of ".join(["a finite number", *filter(None, [" and ".join(bounds)])])
                raise BadInput(f"{parameter.opts[0]}: expected {expected}, got {text!r}")


def _format_help(command: Any, ctx: typer.Context, _formatter: Any) -> None:
    from gcs.commands.help_text import print_help

    print_help(command, ctx)


def _nothing(*, ctx: typer.Context) -> None:
    pass


def whole_command() -> Any:
    """Return the command line with all commands imported, as its reference needs it."""
    command = typer.main.get_group(app)
    assert isinstance(command, _Commands)
    command.load_all()
    return _without_types(command)


def main() -> None:
    """Run the command line; turn exceptions into one plain message and an exit status."""
    warnings.formatwarning = _line_of_warning
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


def _line_of_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    line: str | None = None,
) -> str:
    """Return a warning of ours as a line for people, once; others as Python has them."""
    if category is not RenamedWarning:
        return _PYTHONS_LINE(message, category, filename, lineno, line)
    is_new = str(message) not in _WARNED
    _WARNED.add(str(message))
    return f"warning: {message}\n" if is_new else ""


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

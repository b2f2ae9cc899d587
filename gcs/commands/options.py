"""Options of the commands that talk to a running fleet, and of the dashboard."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import typer

from mavlink_defs.docstrings import texts_of
from mavlink_defs.ports import GCS_PORT, HUB_PORT

SIGNING_KEY_VARIABLE = "FTC_SITL_SIGNING_KEY"
"""Environment variable with the path of a key file."""

UavOption = Annotated[
    str | None,
    typer.Option(
        "--uav", metavar="IDS", help="UAVs by system id, such as 1,3; the whole fleet by default."
    ),
]
ConnectOption = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        envvar="FTC_SITL_CONNECT",
        help=f"udpin:HOST:PORT or udpout:HOST:PORT; by default the hub of `gcs up` (udpout, "
        f"{HUB_PORT}), else udpin:127.0.0.1:{GCS_PORT}.",
    ),
]
TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout",
        min=0.1,
        metavar="S",
        help="How long to wait for a vehicle [s]; six times as long for the answer of one that is "
        "heard all the while.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, nothing else.")]
SigningKeyOption = Annotated[
    str | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        envvar=SIGNING_KEY_VARIABLE,
        help="Sign, and refuse unsigned frames, with this key (of `gcs key`).",
    ),
]
InsecureOption = Annotated[
    bool, typer.Option("--insecure", help="Allow unsigned links that other machines can reach.")
]
ThemeOption: TypeAlias = Annotated[
    Literal["dark", "light"],
    typer.Option("--theme", envvar="FTC_SITL_THEME", help="Colours."),
]


def with_options(
    name: str, options: Iterable[inspect.Parameter], make: Callable[..., Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command options in place of one of its arguments.

    Args:
        name: The argument.
        options: The options, in the order of the help.
        make: Makes the argument of the values of the options.
    """
    options = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        parameters: list[inspect.Parameter] = []
        for own in inspect.signature(command).parameters.values():
            keyword = own.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters += options if own.name == name else [keyword]

        @functools.wraps(command)
        def run(**values: Any) -> None:
            made = make(**{option.name: values.pop(option.name) for option in options})
            command(**values, **{name: made})

        run.__dict__["__signature__"] = inspect.Signature(parameters)  # typer reads both
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate


def options_of(fields: type) -> list[inspect.Parameter]:
    """Return the options that the fields of a dataclass declare; its docstring has their texts."""
    types = {field.name: field.type for field in dataclasses.fields(fields)}
    for name, text in texts_of(fields.__doc__, "Attributes").items():
        get_args(types[name])[1].help = text
    keyword = inspect.Parameter.KEYWORD_ONLY
    return [
        inspect.Parameter(field.name, keyword, default=field.default, annotation=field.type)
        for field in dataclasses.fields(fields)
    ]


LogColumnsOption = Annotated[
    Path | None,
    typer.Option(help="Column map (YAML) of a table, or of outputs.", metavar="FILE"),
]
LogUavOption = Annotated[
    int | None,
    typer.Option(min=1, metavar="ID", help="System id, where a log has several vehicles."),
]

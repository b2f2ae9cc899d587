"""The signing key of gcs's commands: an option of each that meets vehicles, or the environment.

The key itself is read by who uses it; here is only where it lies.
"""

import contextlib
import functools
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from gcs.errors import BadInput
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, exposed, is_loopback
from mavlink_defs.framing.signing import SigningError, read_key

__all__ = ["keyed", "signed", "signing_key", "warn_if_exposed"]

_VARIABLE = "FTC_SITL_SIGNING_KEY"
_Option = Annotated[
    str | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        envvar=_VARIABLE,
        help="Sign, and refuse unsigned frames, with this key (of `gcs key`).",
    ),
]


def signing_key() -> str | None:
    """Path of the key file that the user gave, or None."""
    return os.environ.get(_VARIABLE) or None


def signed(scenario: Scenario) -> Scenario:
    """The scenario with the key that the user gave; else as it is.

    Raises:
        BadInput: The key, or that of the scenario, cannot be used.
    """
    path = signing_key()
    if path is not None:
        scenario = scenario.signed(Path(path))
    if scenario.links.signing_key is not None:
        try:
            read_key(scenario.links.signing_key)
        except SigningError as problem:
            raise BadInput(str(problem)) from None
    return scenario


def warn_if_exposed(address: UdpAddress, with_key: bool) -> None:
    """Say so on standard error if a port that is to be bound can be reached from elsewhere."""
    with contextlib.suppress(EndpointError):  # whoever binds it will complain
        if not is_loopback(address):
            print(exposed(address, with_key), file=sys.stderr)


def keyed(command: Callable[..., None]) -> Callable[..., None]:
    """A command of the command line with the option ``--signing-key`` added."""

    @functools.wraps(command)
    def with_key(*, signing_key: str | None = None, **options: Any) -> None:
        if signing_key:
            os.environ[_VARIABLE] = signing_key
        command(**options)

    before = inspect.signature(command)
    added = inspect.Parameter(
        "signing_key", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_Option
    )
    parameters = [*before.parameters.values(), added]
    with_key.__dict__["__signature__"] = before.replace(parameters=parameters)
    with_key.__annotations__ = {**command.__annotations__, "signing_key": _Option}
    return with_key

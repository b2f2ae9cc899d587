"""Errors that end a command of the ground station, each with its exit status.

GcsError            1  something could not be done
├── BadInput        2  a file, an argument or a port cannot be used
│   └── PortInUse   2  another program has a port
├── CommandRefused  3  a vehicle said no
├── NoAnswer        4  a vehicle said nothing
├── FlightLost      1  the flight did not reach its end
└── Interrupted   130  Ctrl-C, as shells have it; 143 SIGTERM, 129 SIGHUP
"""

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from mavlink_defs.config.problems import ConfigError
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.visible import visible_lines

if TYPE_CHECKING:
    from mavlink_defs.endpoint import EndpointError


class GcsError(Exception):
    """Something could not be done; `hint` says what the user can do."""

    exit_status = 1

    def __init__(self, text: str, hint: str = "") -> None:
        super().__init__(visible_lines(text))
        self.hint = hint


class BadInput(GcsError):  # noqa: N818 - the name says it
    """A file, an argument or a port cannot be used."""

    exit_status = 2


class PortInUse(BadInput):
    """Another program has a port."""


def bad_endpoint(problem: "EndpointError") -> BadInput:
    """Return the error of an address that cannot be used."""
    from mavlink_defs.endpoint import PortTaken  # takes time, of every command

    return (PortInUse if isinstance(problem, PortTaken) else BadInput)(str(problem))


class CommandRefused(GcsError):  # noqa: N818 - the name says it
    """A vehicle answered, but not with ACCEPTED.

    Attributes:
        result: Its MAV_RESULT, MAV_MISSION_RESULT or MAV_PARAM_ERROR.
    """

    exit_status = 3

    def __init__(self, text: str, result: int) -> None:
        super().__init__(text)
        self.result = result


class NoAnswer(GcsError):  # noqa: N818 - the name says it
    """A vehicle did not answer in time."""

    exit_status = 4


class FlightLost(GcsError):  # noqa: N818 - the name says it
    """The flight did not reach its end."""


class Interrupted(GcsError):  # noqa: N818 - the name says it
    """The user stopped the command; signals other than Ctrl-C set their own status."""

    exit_status = 130


@contextlib.contextmanager
def python_errors() -> Iterator[None]:
    """Raise what the command line prints as an error of these, with its hint as a note."""
    try:
        yield
    except (ConfigError, PluginError) as problem:
        raise BadInput(str(problem)) from None
    except GcsError as problem:
        note = f"hint: {problem.hint}"
        if problem.hint and note not in getattr(problem, "__notes__", ()):
            problem.add_note(note)
        raise

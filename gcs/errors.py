"""Errors that end a command of the ground station, each with its exit status.

GcsError            1  something could not be done
├── BadInput        2  a file, an argument or a port cannot be used
├── FlightLost      1  the flight did not reach its end
└── Interrupted   130  Ctrl-C, as shells have it
"""

__all__ = ["BadInput", "FlightLost", "GcsError", "Interrupted"]


class GcsError(Exception):
    """Something could not be done; `hint` says what might help."""

    exit_status = 1

    def __init__(self, text: str, hint: str = "") -> None:
        super().__init__(text)
        self.hint = hint


class BadInput(GcsError):  # noqa: N818 - the name says it
    """A file, an argument or a port cannot be used."""

    exit_status = 2


class FlightLost(GcsError):  # noqa: N818 - the name says it
    """The flight did not reach its end."""


class Interrupted(GcsError):  # noqa: N818 - the name says it
    """The user stopped it."""

    exit_status = 130

"""Entries of the event log: changes of vehicles, their texts and answers."""

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from mavlink_defs import dialect

Kind: TypeAlias = Literal["link", "mode", "text", "ack", "faults", "profile"]

ERROR = dialect.MAV_SEVERITY_ERROR
WARNING = dialect.MAV_SEVERITY_WARNING
NOTICE = dialect.MAV_SEVERITY_NOTICE
INFO = dialect.MAV_SEVERITY_INFO


@dataclass(frozen=True)
class Notification:
    """One entry of the event log.

    Attributes:
        at: Time on the client's clock [s].
        system: System id of the vehicle; 0 for the link itself.
        kind: Its subject: the link, mode and arming, a STATUSTEXT, an answer to a command of any
            ground station (or its absence), faults, the profile.
        severity: MAV_SEVERITY, 0 emergency to 7 debug.
        text: One line of text.
        about: The message, faults or segments concerned, if any.
    """

    at: float
    system: int
    kind: Kind
    severity: int
    text: str
    about: Any = None


def enum_name(enum: str, value: int, prefix: str = "") -> str:
    """Return the name of a value of an enum, without `prefix`; its number if it has no name."""
    entry = dialect.enums[enum].get(value)
    return f"{enum} {value}" if entry is None else str(entry.name).removeprefix(prefix)


def severity_name(severity: int) -> str:
    """Return the name of a MAV_SEVERITY in lower case: "warning"."""
    return enum_name("MAV_SEVERITY", severity, "MAV_SEVERITY_").lower()

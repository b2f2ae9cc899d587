"""Channels of a flight as Foxglove knows them, in MCAP files and live: topics, schemas, messages.

Messages are JSON, their times simulated. Quantities have the units of the recording: SI and rad.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from gcs.results.columns import COLUMNS
from mavlink_defs.constants import ACTUATORS

_Fields = Mapping[str, Mapping[str, Any]]
_NUMBER: Mapping[str, Any] = {"type": ["number", "null"]}
_TEXT: Mapping[str, Any] = {"type": "string"}
_INTEGER: Mapping[str, Any] = {"type": "integer"}


@dataclass(frozen=True)
class ChannelKind:
    """What a channel carries.

    Attributes:
        name: Last part of the topic.
        schema_name: Name of the schema, one of Foxglove's own where it has one.
        fields: Fields of a message and their JSON schemas.
    """

    name: str
    schema_name: str
    fields: _Fields

    def topic(self, system: int) -> str:
        """Return the topic of a UAV; 0: of the whole fleet."""
        return f"/uav{system}/{self.name}" if system else f"/{self.name}"

    @property
    def schema(self) -> bytes:
        """JSON schema of the messages."""
        fields = {name: dict(schema) for name, schema in self.fields.items()}
        return json.dumps({"type": "object", "properties": fields}).encode()


def state_kind(names: Iterable[str]) -> ChannelKind:
    """Return the kind of states with columns of a recording; KeyError if it has no such column."""
    known = {column.name for column in COLUMNS}
    for name in names:
        if name not in known:
            raise KeyError(name)
    return ChannelKind("state", "ftc_sitl.state", dict.fromkeys(names, _NUMBER))


LOCATION = ChannelKind(
    "location",
    "foxglove.LocationFix",
    dict.fromkeys(("latitude", "longitude", "altitude"), _NUMBER),
)
"""Place: latitude and longitude [deg], altitude above the sea [m]."""

EVENT = ChannelKind(
    "event", "ftc_sitl.event", {"actuator": _TEXT, "value": _NUMBER, "count": _INTEGER}
)
"""A transmission: its actuator, the command sent [rad, N], and its number on that channel."""

FAULTS = ChannelKind("faults", "ftc_sitl.faults", dict.fromkeys(ACTUATORS, _TEXT))
"""What the plant does to each actuator: "none", or the description of the fault."""

_SECONDS: Mapping[str, Any] = {
    "type": "object",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
TEXTS = ChannelKind(
    "texts",
    "foxglove.Log",
    MappingProxyType(
        {"timestamp": _SECONDS, "level": _INTEGER, "message": _TEXT, "name": _TEXT, "file": _TEXT}
        | {"line": _INTEGER}
    ),
)
"""Entries of the event log of all vehicles: texts, modes, answers, faults, links."""


def nanoseconds(time_s: float) -> int:
    """Return a time as channels have it [ns]."""
    return round(time_s * 1e9)


def encoded(values: Mapping[str, Any]) -> bytes:
    """Return a message; what is not known (NaN) becomes null."""
    known = {name: None if _is_nan(value) else value for name, value in values.items()}
    return json.dumps(known, allow_nan=False).encode()


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)

"""What is in a log, as tables for the terminal and as plain data."""

from collections.abc import Iterator, Sequence
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from gcs.console.terminal import bulleted, numbers, table_of, texts
from gcs.results.logs.table import FlightTable, LogChannel
from mavlink_defs.config.problems import counted

_SHOWN_TEXTS = 40
_SEVERE = 4  # MAV_SEVERITY of a warning; what is less is worse


def log_tables(flight: FlightTable) -> Iterator[Table | Text | str]:
    """Yield what `gcs log` prints of a flight: how long, its channels, modes, texts, remarks."""
    yield _headline(flight)
    yield _channels(flight)
    if flight.modes:
        yield "modes: " + ", ".join(f"{name} from {at:.1f} s" for at, name in flight.modes)
    if flight.texts:
        yield _texts(flight)
    if flight.parameters:
        yield f"{counted(len(flight.parameters), 'parameter')}; --json has them"
    if flight.remarks:
        yield bulleted([Text(one) for one in flight.remarks])


def log_json(flight: FlightTable) -> dict[str, Any]:
    """Return the same as plain data."""
    return {
        "title": flight.title,
        "kind": flight.kind,
        "started": None if flight.started is None else flight.started.isoformat(),
        "begin_s": flight.begin_s,
        "end_s": flight.end_s,
        "channels": [_channel_json(one) for one in flight.channels.values()],
        "modes": [{"time_s": at, "mode": name} for at, name in flight.modes],
        "texts": [vars(one) for one in flight.texts],
        "parameters": dict(flight.parameters),
        "remarks": list(flight.remarks),
    }


def _channel_json(one: LogChannel) -> dict[str, Any]:
    return {
        "name": one.name,
        "unit": one.unit,
        "values": len(one.values),
        "rate_hz": one.rate_hz,
        "renewed_hz": one.renewed_hz,
        "begin_s": float(one.time_s[0]),
        "end_s": float(one.time_s[-1]),
        "gaps_s": [list(gap) for gap in one.gaps],
        "clock": one.clock,
        "source": one.source,
    }


def _headline(flight: FlightTable) -> Text:
    began = "" if flight.started is None else f", began {flight.started:%Y-%m-%d %H:%M:%S} UTC"
    text = f": {flight.kind}, {flight.duration_s:.1f} s{began}"
    return Text.assemble((flight.title, "bold"), text)


def _channels(flight: FlightTable) -> Table:
    table = table_of(
        texts("channel"),
        numbers("per second"),
        numbers("new per second"),
        numbers("from [s]"),
        numbers("to [s]"),
        texts("gaps"),
        texts("clock"),
        texts("in the log"),
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for one in flight.channels.values():
        longest = max((end - begin for begin, end in one.gaps), default=0.0)
        table.add_row(
            f"{one.name} [{one.unit}]" if one.unit else one.name,
            "by event" if one.by_event else f"{one.rate_hz:.3g}",
            f"{one.renewed_hz:.3g}",
            f"{one.time_s[0]:.2f}",
            f"{one.time_s[-1]:.2f}",
            f"{len(one.gaps)}, of {longest:.3g} s at most" if one.gaps else "",
            one.clock,
            one.source,
        )
    return table


def _texts(flight: FlightTable) -> Table:
    chosen: Sequence[Any] = flight.texts
    if len(chosen) > _SHOWN_TEXTS:
        chosen = [one for one in chosen if one.severity <= _SEVERE][:_SHOWN_TEXTS]
    left_out = len(flight.texts) - len(chosen)
    heading = f"text ({left_out} of {len(flight.texts)} left out; --json has all)"
    table = table_of(
        numbers("at [s]"),
        texts(heading if left_out else "text"),
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for one in chosen:
        table.add_row(
            f"{one.time_s:.2f}", Text(one.text, "bold" if one.severity <= _SEVERE else "")
        )
    return table

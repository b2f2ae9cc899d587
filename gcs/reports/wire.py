"""The counts of a tap as tables for the terminal and as CSV."""

import csv
from typing import TextIO

from rich.table import Table

from gcs.console.terminal import numbers, table_of, texts
from gcs.results.quantities import milliseconds, percent
from mavlink_defs.capture.tap_report import LinkReport, StreamReport, TapReport
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_ftc_neighbour_message

_COLUMNS = (
    "kind",
    "link",
    "direction",
    "system",
    "component",
    "name",
    "count",
    "bytes",
    "rate_hz",
    "periodic",
    "saving",
)
_NEIGHBOUR: str = MAVLink_ftc_neighbour_message.msgname
_OUTCOMES = {
    "lost": "lost",
    "outage": "in outages",
    "duplicated": "doubled",
    "reordered": "overtaken",
    "damaged": "damaged",
    "undeliverable": "undeliverable",
}


def wire_tables(report: TapReport, live: bool = False) -> list[Table | str]:
    """Return what `gcs wire` prints: transmissions per actuator channel, links, messages, totals.

    Args:
        report: From a tap or a relay.
        live: Rates at the time of the report instead of the mean.
    """
    tables: list[Table | str] = [_transmissions(report)] if report.uavs else []
    tables += [_links(report, live), _messages(report, live)]
    datagrams = sum(link.datagrams for link in report.links)
    total = f"{datagrams} datagrams, {sum(link.bytes for link in report.links)} bytes"
    total += f" in {report.span_s:.1f} s"
    if report.saving is not None:
        total += f"; saved {percent(report.saving)} of periodic transmissions"
    return [*tables, total]


def write_csv(report: TapReport, file: TextIO) -> None:
    """Write one row per message stream, actuator channel, and reason to drop a datagram.

    Column `kind` distinguishes them: "message", "channel" and "dropped".
    """
    writer = csv.DictWriter(file, _COLUMNS)
    writer.writeheader()
    for row in report.messages:
        writer.writerow(
            {
                "kind": "message",
                "link": row.link,
                "direction": row.direction,
                "system": row.system,
                "component": row.component,
                "name": row.message,
                "count": row.frames,
                "bytes": row.bytes,
                "rate_hz": row.mean_hz,
            }
        )
    for uav in report.uavs:
        for name, channel in uav.channels.items():
            writer.writerow(
                {
                    "kind": "channel",
                    "link": uav.link,
                    "system": uav.system,
                    "name": name,
                    "count": channel.events,
                    "periodic": uav.periods,
                    "saving": channel.saving,
                }
            )
    for link in report.links:
        for reason, count in link.dropped.items():
            where = {"link": link.link, "direction": link.direction}
            writer.writerow({"kind": "dropped", **where, "name": reason, "count": count})


def _links(report: TapReport, live: bool) -> Table:
    outcomes = {(fate.link, fate.direction): fate.counts for fate in report.fates or ()}
    figures = map(numbers, ("datagrams", "bytes", "1/s", "bytes/s"))
    table = table_of(texts("link"), *figures, texts("remarks"), title="Links")
    for row in report.links:
        counts = outcomes.get((row.link, row.direction), {})
        remarks = [f"{n} {reason}" for reason, n in row.dropped.items()]
        remarks += [f"{counts[key]} {text}" for key, text in _OUTCOMES.items() if counts.get(key)]
        rates: tuple[float | None, float | None] = (row.rate_hz, row.bytes_per_s)
        if not live:
            rates = (_rate(row.datagrams, report.span_s), _rate(row.bytes, report.span_s))
        shown = (str(row.datagrams), str(row.bytes), _number(rates[0]), _number(rates[1]))
        table.add_row(_way(row), *shown, ", ".join(remarks))
    return table


def _messages(report: TapReport, live: bool) -> Table:
    signed = any(row.signed for row in report.messages)
    columns = map(texts, ("link", "sender", "message"))
    figures = map(numbers, ("frames", "bytes", "1/s", *["signed"] * signed))
    table = table_of(*columns, *figures, title="Messages, by system/component")
    before = None
    for row in report.messages:
        way = _way(row)
        if before not in {None, way}:
            table.add_section()
        table.add_row(
            way if way != before else "",
            f"{row.system}/{row.component}",
            row.message,
            str(row.frames),
            str(row.bytes),
            _number(row.rate_hz if live else row.mean_hz),
            *[str(row.signed)] * signed,
        )
        before = way
    return table


def _transmissions(report: TapReport) -> Table:
    columns = map(texts, ("link", "UAV", "channel"))
    figures = map(numbers, ("sent", "periodic", "saved", "min. interval", "repeats"))
    title = "Actuator transmissions against periodic sending"
    table = table_of(*columns, *figures, title=title)
    if any(uav.reported for uav in report.uavs):
        table.caption = "* not seen, but reported by the autopilot (FTC_EVENTS)"
    for uav in report.uavs:
        note = "*" if uav.reported else ""
        for i, (name, channel) in enumerate(uav.channels.items()):
            table.add_row(
                uav.link if i == 0 else "",
                f"{uav.system}{note}" if i == 0 else "",
                name,
                str(channel.events),
                "-" if uav.periods is None else str(uav.periods),
                percent(channel.saving),
                milliseconds(channel.min_interval_s),
            )
        periodic = "-" if uav.periods is None else str(uav.periods * len(ACTUATORS))
        saved, repeats = percent(uav.saving), str(uav.repeats)
        table.add_row("", "", "all", str(uav.events), periodic, saved, "", repeats, style="bold")
        if sent := _to_neighbours(report, uav.system):
            table.add_row("", "", "to neighbours", str(sent), "-", "-", "", "")
        table.add_section()
    return table


def _to_neighbours(report: TapReport, system: int) -> int:
    """Return how many messages a UAV sent its neighbours, one to each of them."""
    own = (row for row in report.messages if row.system == system)
    return sum(row.frames for row in own if row.message == _NEIGHBOUR)


def _way(row: LinkReport | StreamReport) -> str:
    return f"{row.direction} {row.link}"


def _rate(count: int, span_s: float) -> float | None:
    return count / span_s if span_s > 0.0 else None


def _number(x: float | None) -> str:
    return "-" if x is None else f"{x:.1f}" if x < 100.0 else f"{x:.0f}"

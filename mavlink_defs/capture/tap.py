"""The tap: counts what crosses the links of a fleet, from datagrams and their times alone.

It knows the public wire format and no state of any process, so what it counts is what any
sniffer can count. One datagram may hold several frames. A frame is counted per link, direction,
system, component and message; a datagram that is not MAVLink 2 of this dialect is counted by
the reason. Directions are seen from the fixed end of a link: "to" the plant, "from" the plant.

Control transmissions (`mavlink_defs.capture.transmissions`) are compared with periodic sending:
one per channel and control period, and FTC_SIM_STATE gives the number of periods.

Counting itself is compiled (`mavlink_defs.capture.tap_counts`), so that a relay can do it without
the interpreter.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.capture.saving import saving
from mavlink_defs.capture.tap_counts import (
    EMPTY,
    OLDER_VERSION,
    add_flow,
    count,
    forget,
    new_counts,
    with_room,
)
from mavlink_defs.capture.tap_report import LinkReport, StreamReport, TapReport, UavReport
from mavlink_defs.capture.transmissions import counted, reported
from mavlink_defs.constants import ACTUATORS, LAST_SYSTEM, MAX_DATAGRAM
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import parse
from mavlink_defs.ports import FORMATION_BASE_PORT, GCS_PORT, PLANT_PORT

DEFAULT_PORTS: Mapping[int, str] = {
    GCS_PORT: "gcs",
    PLANT_PORT: "plant",
    **{FORMATION_BASE_PORT + uav: "formation" for uav in range(1, LAST_SYSTEM + 1)},
}
"""Default ports of fixed ends, and their links."""

_DROPPED = {
    EMPTY: "empty",
    OLDER_VERSION: "MAVLink 1",
    **{-reason: reason.text for reason in DropReason},
}
"""Why a datagram is dropped, by column of `Counts.dropped`."""


class Stream(NamedTuple):
    """Frames of one message from one sender on one link."""

    link: str
    direction: str
    system: int
    component: int
    message_id: int


class Tap:
    """Counts datagrams; no socket, no clock.

    Args:
        window_s: Length of the window that rates are taken over [s].
        period_us: Control period, used if no FTC_SIM_STATE gives their number [µs].
    """

    def __init__(self, window_s: float = 1.0, period_us: int | None = None) -> None:
        self._window_s, self._period_us = window_s, period_us
        self._flows: dict[tuple[str, str], int] = {}
        self._links: dict[str, int] = {}
        self._data = np.zeros(MAX_DATAGRAM, np.uint8)
        self.counts = new_counts(window_s)
        """For compiled code, which counts as `count` does; `make_room` replaces them."""

    @property
    def simulated_s(self) -> float | None:
        """Simulation time of the newest running FTC_SIM_STATE [s]; None before the first."""
        time_s = float(self.counts.state[0]["simulated_s"])
        return None if math.isnan(time_s) else time_s

    def flow(self, link: str, direction: str) -> int:
        """Return the number of a link's direction in `counts`."""
        number = self._flows.get((link, direction))
        if number is None:
            of_link = self._links.setdefault(link, len(self._links))
            self.counts, number = add_flow(self.counts, of_link)
            self._flows[link, direction] = number
        return number

    def make_room(self, length: int) -> None:
        """Make room in `counts` for a datagram of some length [bytes]."""
        self.counts = with_room(self.counts, length)

    def count(self, time_s: float, link: str, direction: str, datagram: bytes) -> None:
        """Count one datagram.

        Args:
            time_s: Time of the datagram [s], on any clock.
            link: Name of the link.
            direction: "to" or "from" the fixed end of the link.
            datagram: Its UDP payload.
        """
        flow, length = self.flow(link, direction), len(datagram)
        self._data[:length] = np.frombuffer(datagram, np.uint8)
        while not count(self.counts, float(time_s), flow, self._data, length):
            self.make_room(length)

    def events(self, system: int, channel: str, link: str = "plant") -> int:
        """Return the number of transmissions of one actuator channel ("rudder") of one UAV."""
        uav = self._uav(link, system)
        return 0 if uav is None else int(uav["events"][ACTUATORS.index(channel)])

    def report(self, now_s: float | None = None) -> TapReport:
        """Return everything counted.

        Args:
            now_s: Time of the rates, not before the last datagram [s]; None: that datagram's.
        """
        state = self.counts.state[0]
        forget(self.counts, float(state["last_s"] if now_s is None else now_s))
        first_s, last_s = float(state["first_s"]), float(state["last_s"])
        span_s = 0.0 if math.isnan(first_s) else last_s - first_s
        uavs = self._uav_reports()
        return TapReport(
            span_s=span_s,
            links=tuple(
                self._link(key, flow)
                for key, flow in sorted(self._flows.items())
                if self.counts.flows[flow]["datagrams"]
            ),
            messages=tuple(
                self._message(stream, row, span_s)
                for stream, row in sorted(self._streams(), key=lambda entry: entry[0])
            ),
            uavs=uavs,
            saving=_total_saving(uavs),
        )

    def _streams(self) -> Iterator[tuple[Stream, np.void]]:
        flows = list(self._flows)
        for row in self.counts.streams[: self.counts.state[0]["streams"]]:
            key = int(row["key"])
            link, direction = flows[(key >> 40) - 1]
            sender = (key >> 32) & 0xFF, (key >> 24) & 0xFF
            yield Stream(link, direction, *sender, key & 0xFFFFFF), row

    def _uavs(self) -> Iterator[tuple[str, int, np.void, bytes]]:
        """Return link, system, counts and last FTC_EVENTS of each UAV."""
        links = list(self._links)
        for i in range(self.counts.state[0]["uavs"]):
            row = self.counts.uavs[i]
            link, system = divmod(int(row["key"]) - 1, 256)
            yield links[link], system, row, self.counts.reports[i, : row["report_size"]].tobytes()

    def _uav(self, link: str, system: int) -> np.void | None:
        return next((u for at, i, u, _ in self._uavs() if (at, i) == (link, system)), None)

    def _uav_reports(self) -> tuple[UavReport, ...]:
        """Return the counts; for UAVs whose transmissions were not captured, their own reports."""
        uavs = list(self._uavs())
        found = [
            counted(link, system, row, self._period_us)
            for link, system, row, _ in uavs
            if row["messages"]
        ]
        known = {uav.system for uav in found}
        found += [
            reported(link, message)
            for link, system, _, frame in uavs
            if system not in known
            and isinstance(message := parse(frame), dialect.MAVLink_ftc_events_message)
        ]
        found.sort(key=lambda uav: (uav.link, uav.system))
        return tuple(uav for uav in found if uav.messages)

    def _link(self, key: tuple[str, str], flow: int) -> LinkReport:
        row, dropped = self.counts.flows[flow], self.counts.dropped[flow]
        return LinkReport(
            *key,
            datagrams=int(row["datagrams"]),
            bytes=int(row["bytes"]),
            rate_hz=int(row["recent"]) / self._window_s,
            bytes_per_s=int(row["recent_bytes"]) / self._window_s,
            dropped={reason: int(dropped[i]) for i, reason in _DROPPED.items() if dropped[i]},
        )

    def _message(self, stream: Stream, row: np.void, span_s: float) -> StreamReport:
        frames = int(row["frames"])
        return StreamReport(
            *stream,
            message=_name(stream.message_id),
            frames=frames,
            bytes=int(row["bytes"]),
            signed=int(row["signed"]),
            rate_hz=int(row["recent"]) / self._window_s,
            mean_hz=frames / span_s if span_s > 0.0 else None,
        )


class LinkNames:
    """Names links by the port of their fixed end."""

    def __init__(self, ports: Mapping[int, str] = DEFAULT_PORTS) -> None:
        self._ports = ports

    def of(self, source: UdpAddress, destination: UdpAddress) -> tuple[str, str]:
        """Return link and direction of a datagram; an unknown link is named by its addresses."""
        if destination.port in self._ports:
            return self._ports[destination.port], "to"
        if source.port in self._ports:
            return self._ports[source.port], "from"
        near, far = sorted(map(str, (source, destination)))
        return f"{near} / {far}", "to" if str(destination) == far else "from"


def _name(message_id: int) -> str:
    return str(dialect.mavlink_map[message_id].msgname)


def _total_saving(uavs: Sequence[UavReport]) -> float | None:
    """Return the saving of all UAVs; counts here take precedence over their reports."""
    known = [uav for uav in uavs if uav.periods is not None]
    counted = [uav for uav in known if not uav.reported] or known
    periods = sum(uav.periods or 0 for uav in counted)
    return saving(sum(uav.events for uav in counted), periods)

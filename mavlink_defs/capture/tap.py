"""The tap: counts what crosses the links of a fleet, from datagrams and their times alone.

It knows the public wire format and no state of any process, so what it counts is what any
sniffer can count. One datagram may hold several frames. A frame is counted per link, direction,
system, component and message; a datagram that is not MAVLink 2 of this dialect is counted by
the reason. Directions are seen from the fixed end of a link: "to" the plant, "from" the plant.

Control transmissions (`mavlink_defs.capture.transmissions`) are compared with periodic sending:
one per channel and control period, and FTC_SIM_STATE gives the number of periods.
"""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from mavlink_defs import dialect
from mavlink_defs.capture.tap_report import LinkReport, StreamReport, TapReport, UavReport
from mavlink_defs.capture.transmissions import Transmissions, reported, saving
from mavlink_defs.constants import ACTUATORS, FORMATION_BASE_PORT, GCS_PORT, LAST_SYSTEM, PLANT_PORT
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import frame_size, parse

__all__ = ["DEFAULT_PORTS", "LinkNames", "Stream", "Tap"]

DEFAULT_PORTS: Mapping[int, str] = {
    GCS_PORT: "gcs",
    PLANT_PORT: "plant",
    **{FORMATION_BASE_PORT + uav: "formation" for uav in range(1, LAST_SYSTEM + 1)},
}
"""Default ports of fixed ends, and their links."""

_ACTUATORS = dialect.MAVLink_hil_actuator_controls_message
_STATE = dialect.MAVLink_ftc_sim_state_message
_EVENTS = dialect.MAVLink_ftc_events_message
_STEP = 17  # number of FTC_SIM_STATE.step among its numbers: behind two times and five vectors


class Stream(NamedTuple):
    """Frames of one message from one sender on one link."""

    link: str
    direction: str
    system: int
    component: int
    message_id: int


class Rate:
    """Traffic within the last `window_s` seconds."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._recent: deque[tuple[float, int]] = deque()
        self._bytes = 0

    def add(self, time_s: float, size: int) -> None:
        """Take in one frame of `size` bytes."""
        self._recent.append((time_s, size))
        self._bytes += size
        self._forget(time_s)

    def at(self, now_s: float) -> tuple[float, float]:
        """Return frames and bytes per second at a time not before the last one added."""
        self._forget(now_s)
        return len(self._recent) / self._window_s, self._bytes / self._window_s

    def _forget(self, now_s: float) -> None:
        recent, begin_s = self._recent, now_s - self._window_s
        while recent and recent[0][0] <= begin_s:
            self._bytes -= recent.popleft()[1]


@dataclass
class Count:
    """Frames of one stream."""

    rate: Rate
    frames: int = 0
    bytes: int = 0
    signed: int = 0


@dataclass
class Flow:
    """Datagrams in one direction of one link; `dropped` by reason: no frames of the dialect."""

    rate: Rate
    datagrams: int = 0
    bytes: int = 0
    dropped: Counter[str] = field(default_factory=Counter)


class Tap:
    """Counts datagrams; no socket, no clock.

    Args:
        window_s: Length of the window that rates are taken over [s].
        period_us: Control period, used if no FTC_SIM_STATE gives their number [µs].
    """

    def __init__(self, window_s: float = 1.0, period_us: int | None = None) -> None:
        self._window_s, self._period_us = window_s, period_us
        self._flows: dict[tuple[str, str], Flow] = {}
        self._counts: dict[Stream, Count] = {}
        self._uavs: dict[tuple[str, int], Transmissions] = {}
        self._reports: dict[tuple[str, int], dialect.MAVLink_ftc_events_message] = {}
        self._first_s: float | None = None
        self._last_s = 0.0
        self.simulated_s: float | None = None
        """Simulation time of the newest running FTC_SIM_STATE [s]; None before the first."""

    def count(self, time_s: float, link: str, direction: str, datagram: bytes) -> None:
        """Count one datagram.

        Args:
            time_s: Time of the datagram [s], on any clock.
            link: Name of the link.
            direction: "to" or "from" the fixed end of the link.
            datagram: Its UDP payload.
        """
        if self._first_s is None:
            self._first_s = self._last_s = time_s
        self._last_s = max(self._last_s, time_s)
        flow = self._flows.get((link, direction))
        if flow is None:
            flow = self._flows[link, direction] = Flow(Rate(self._window_s))
        flow.datagrams += 1
        flow.bytes += len(datagram)
        flow.rate.add(time_s, len(datagram))
        rest = datagram
        while True:
            size, wrong = frame_size(rest)
            if wrong is not None:
                flow.dropped[_words(rest, wrong)] += 1
                return
            self._count_frame(time_s, link, direction, rest[:size])
            if size == len(rest):
                return
            rest = rest[size:]

    def frames(self, message: str | None = None, **where: str | int) -> int:
        """Return the number of frames of the streams whose fields have these values.

        For example ``tap.frames("HIL_ACTUATOR_CONTROLS", link="plant", system=3)``.
        """
        return sum(
            count.frames
            for stream, count in self._counts.items()
            if message in {None, _name(stream.message_id)}
            and all(getattr(stream, key) == value for key, value in where.items())
        )

    def events(self, system: int, channel: str, link: str = "plant") -> int:
        """Return the number of transmissions of one actuator channel ("rudder") of one UAV."""
        uav = self._uavs.get((link, system))
        return 0 if uav is None else uav.events[ACTUATORS.index(channel)]

    def min_interval_s(self, system: int, channel: str, link: str = "plant") -> float | None:
        """Return the shortest interval of a channel [s, simulated]; None with fewer than two."""
        uav = self._uavs.get((link, system))
        shortest = None if uav is None else uav.min_interval_us[ACTUATORS.index(channel)]
        return None if shortest is None else shortest / 1e6

    def report(self, now_s: float | None = None) -> TapReport:
        """Return everything counted.

        Args:
            now_s: Time of the rates, not before the last datagram [s]; None: that datagram's.
        """
        now = self._last_s if now_s is None else now_s
        span_s = self._last_s - (self._first_s or 0.0) if self._flows else 0.0
        uavs = self._uav_reports()
        return TapReport(
            span_s=span_s,
            links=tuple(_flow(key, flow, now) for key, flow in sorted(self._flows.items())),
            messages=tuple(
                _count(key, count, now, span_s) for key, count in sorted(self._counts.items())
            ),
            uavs=uavs,
            saving=_total_saving(uavs),
        )

    def _uav_reports(self) -> tuple[UavReport, ...]:
        """Return the counts; for UAVs whose transmissions were not captured, their own reports."""
        found = [
            uav.report(link, system, self._period_us) for (link, system), uav in self._uavs.items()
        ]
        counted = {uav.system for uav in found if uav.messages}
        found += [
            reported(link, message)
            for (link, system), message in self._reports.items()
            if system not in counted
        ]
        found.sort(key=lambda uav: (uav.link, uav.system))
        return tuple(uav for uav in found if uav.messages)

    def _count_frame(self, time_s: float, link: str, direction: str, frame: bytes) -> None:
        system, component = frame[5], frame[6]
        message_id = int.from_bytes(frame[7:10], "little")
        stream = Stream(link, direction, system, component, message_id)
        count = self._counts.get(stream)
        if count is None:
            count = self._counts[stream] = Count(Rate(self._window_s))
        count.frames += 1
        count.bytes += len(frame)
        count.signed += frame[2] & dialect.MAVLINK_IFLAG_SIGNED
        count.rate.add(time_s, len(frame))
        if message_id == _EVENTS.id and isinstance(report := parse(frame), _EVENTS):
            self._reports[link, system] = report
        elif message_id in {_ACTUATORS.id, _STATE.id}:
            uav = self._uavs.setdefault((link, system), Transmissions())
            self._read_payload(frame, message_id, uav)

    def _read_payload(self, frame: bytes, message_id: int, uav: Transmissions) -> None:
        payload = frame[dialect.HEADER_LEN_V2 : dialect.HEADER_LEN_V2 + frame[1]]
        unpacker = (_ACTUATORS if message_id == _ACTUATORS.id else _STATE).unpacker
        fields = unpacker.unpack(payload[: unpacker.size].ljust(unpacker.size, b"\0"))
        if message_id == _ACTUATORS.id:  # time_usec, flags, controls[16], mode
            uav.transmission(fields[0], fields[2 : 2 + len(ACTUATORS)])
            return
        step, flags, run = fields[_STEP : _STEP + 3]
        if flags & dialect.FTC_SIM_FLAGS_RUNNING:
            uav.step(step, run)
            self.simulated_s = fields[0] / 1e6


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


def _flow(key: tuple[str, str], flow: Flow, now_s: float) -> LinkReport:
    rate_hz, bytes_per_s = flow.rate.at(now_s)
    return LinkReport(
        *key,
        datagrams=flow.datagrams,
        bytes=flow.bytes,
        rate_hz=rate_hz,
        bytes_per_s=bytes_per_s,
        dropped=dict(flow.dropped),
    )


def _count(stream: Stream, count: Count, now_s: float, span_s: float) -> StreamReport:
    return StreamReport(
        *stream,
        message=_name(stream.message_id),
        frames=count.frames,
        bytes=count.bytes,
        signed=count.signed,
        rate_hz=count.rate.at(now_s)[0],
        mean_hz=count.frames / span_s if span_s > 0.0 else None,
    )


def _words(data: bytes, reason: DropReason) -> str:
    """Return why bytes are no frame; other protocols on a port are distinguished from damage."""
    if not data:
        return "empty"
    return "MAVLink 1" if data[0] == dialect.PROTOCOL_MARKER_V1 else reason.words

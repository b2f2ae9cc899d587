"""Counts of a tap or a relay, as data; `to_json` and `from_json` for wire.json."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self


@dataclass(frozen=True)
class LinkReport:
    """Datagrams in one direction of one link.

    Attributes:
        link: Name of the link.
        direction: "to" or "from" its fixed end.
        datagrams: Their number.
        bytes: Their size.
        rate_hz: Datagrams per second at the time of the report.
        bytes_per_s: Bytes per second at the time of the report.
        dropped: Datagrams that hold something else than frames of the dialect, by reason.
    """

    link: str
    direction: str
    datagrams: int
    bytes: int
    rate_hz: float
    bytes_per_s: float
    dropped: Mapping[str, int]


@dataclass(frozen=True)
class StreamReport:
    """Frames of one message from one sender in one direction of one link.

    Attributes:
        link: Name of the link.
        direction: "to" or "from" its fixed end.
        system: System id of the sender.
        component: Component id of the sender.
        message_id: Number of the message.
        message: Name of the message.
        frames: Their number.
        bytes: Their size.
        signed: Number of frames with a signature.
        rate_hz: Frames per second at the time of the report.
        mean_hz: Frames per second over the whole time; None if that is 0.
    """

    link: str
    direction: str
    system: int
    component: int
    message_id: int
    message: str
    frames: int
    bytes: int
    signed: int
    rate_hz: float
    mean_hz: float | None


@dataclass(frozen=True)
class ChannelReport:
    """Transmissions of one actuator channel of one UAV.

    Attributes:
        events: Transmissions.
        saving: Share of the periodic sender's that were not sent; None if unknown.
        min_interval_s: Shortest simulated time between two [s]; None with fewer than two.
    """

    events: int
    saving: float | None
    min_interval_s: float | None


@dataclass(frozen=True)
class UavReport:
    """Control transmissions of one UAV on one link.

    Attributes:
        link: Name of the link.
        system: System id.
        reported: Whether the numbers are not counted here but the autopilot's own FTC_EVENTS.
        periods: Control periods that passed; None if unknown.
        saving: Share of the periodic sender's transmissions that were not sent; None if unknown.
        messages: HIL_ACTUATOR_CONTROLS.
        repeats: Messages without an event; if `reported`, events that were sent again.
        channels: By name, in the order of `ACTUATORS`.
    """

    link: str
    system: int
    reported: bool
    periods: int | None
    saving: float | None
    messages: int
    repeats: int
    channels: Mapping[str, ChannelReport]

    @property
    def events(self) -> int:
        """Transmissions of all channels."""
        return sum(channel.events for channel in self.channels.values())


@dataclass(frozen=True)
class OutcomeReport:
    """Outcome counts of the datagrams in one direction of a relayed link.

    Attributes:
        link: Name of the link.
        direction: "to" or "from" its fixed end.
        counts: Datagrams by outcome: "undeliverable", and the members of `Fate` if impaired.
    """

    link: str
    direction: str
    counts: Mapping[str, int]


@dataclass(frozen=True)
class TapReport:
    """Everything counted.

    Attributes:
        span_s: Time from the first to the last datagram [s].
        links: By link and direction.
        messages: By link, direction, sender and message.
        uavs: Actuator transmissions.
        saving: Share of all periodic transmissions that were not sent; None if unknown.
        fates: Outcomes on a relay's links; None without a relay.
    """

    span_s: float
    links: tuple[LinkReport, ...]
    messages: tuple[StreamReport, ...]
    uavs: tuple[UavReport, ...]
    saving: float | None
    fates: tuple[OutcomeReport, ...] | None = None

    def uav(self, link: str, system: int) -> UavReport | None:
        """Return the transmissions of one UAV on one link; None if it had none."""
        return next((u for u in self.uavs if (u.link, u.system) == (link, system)), None)

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain data, with the keys of wire.json."""
        tree = asdict(self)
        if tree["fates"] is None:
            del tree["fates"]
        else:
            tree["fates"] = [
                {"link": fate.link, "direction": fate.direction, **fate.counts}
                for fate in self.fates or ()
            ]
        return tree

    @classmethod
    def from_json(cls, tree: object) -> Self:
        """Read what `to_json` made.

        Raises:
            ValueError: It is something else.
        """
        from pydantic import TypeAdapter

        if isinstance(tree, dict) and isinstance(fates := tree.get("fates"), list):
            tree = tree | {"fates": [_nested(fate) for fate in fates]}
        return TypeAdapter(cls).validate_python(tree)


def _nested(fate: object) -> object:
    """Return an entry of "fates" with its counts apart from the link and direction."""
    if not isinstance(fate, dict):
        return fate
    where = {key: fate[key] for key in ("link", "direction") if key in fate}
    return where | {"counts": {key: n for key, n in fate.items() if key not in where}}

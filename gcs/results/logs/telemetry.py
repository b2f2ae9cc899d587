"""Telemetry logs (`.tlog`, MAVLink 1 and 2) of one vehicle.

Messages of one kind are decoded together, by the dialect's layouts. Times are the vehicle's own;
messages without one are placed by what was heard around them.
"""

from collections.abc import Iterator, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import TOOLS_PACKAGES, missing
from gcs.results.logs.clocks import longest_stretch, utc
from gcs.results.logs.fields import rows
from gcs.results.logs.reading import chosen_vehicle
from gcs.results.logs.table import FlightTable, LogText, by_name
from gcs.results.logs.telemetry_fields import ARDUPILOT, MESSAGES, PX4, message_channels
from gcs.results.logs.telemetry_systems import HeardSystem, layout_of, read_systems
from mavlink_defs import dialect
from mavlink_defs.constants import MODE_NAMES
from mavlink_defs.services.statustext import TextAssembler
from mavlink_defs.visible import visible

_UNIX_S = 1e8
"""Times above are since 1970, below since boot [s]."""


def read_telemetry(path: Path, uav: int | None) -> FlightTable:
    """Read what a telemetry log has of one vehicle.

    Args:
        path: The log.
        uav: System id; None: the one with the most to say of its attitude.

    Raises:
        BadInput: It cannot be read, is none, or has no such vehicle.
    """
    systems, remarks = read_systems(path)
    chosen, others = _choose(path, systems, uav)
    remarks += others
    heard = systems[chosen]
    clock = _Clock.of(heard, remarks)
    channels = by_name(
        one
        for name, fields in MESSAGES
        if name in heard.kinds
        for one in message_channels(name, fields, heard, *clock.times(heard, name))
    )
    if not channels:
        raise BadInput(
            f"{path}: system {chosen} sent nothing of a flight, such as ATTITUDE",
            f"it sent {', '.join(sorted(heard.kinds))}",
        )
    return FlightTable(
        title=f"{visible(path.name)}, system {chosen}",
        kind="tlog",
        channels=channels,
        modes=tuple(_modes(heard, clock)),
        texts=tuple(_texts(heard, clock)),
        parameters=_parameters(heard),
        started=utc(clock.heard_at_0) if clock.heard_at_0 > _UNIX_S else None,
        remarks=tuple(remarks),
    )


def _choose(path: Path, systems: dict[int, HeardSystem], uav: int | None) -> tuple[int, list[str]]:
    """As `chosen_vehicle`, which no ground station is."""
    for system in list(systems):
        if systems[system].heartbeat.get("type") == dialect.MAV_TYPE_GCS:
            del systems[system]
    if not systems:
        raise BadInput(f"{path} has frames of ground stations only")

    def attitudes(system: int) -> tuple[int, int]:
        kinds = [systems[system].kinds.get(f"ATTITUDE{one}") for one in ("", "_QUATERNION")]
        return max(len(one.places) for one in kinds if one) if any(kinds) else 0, -system

    return chosen_vehicle(path, systems, uav, max(systems, key=attitudes))


class _Clock:
    """The flight's time: the vehicle's since boot, or simulated time where it sends that.

    Attributes:
        name: Of the clock.
        heard_at_0: Time of reception at 0 [s].
        has_jumped: Whether what was heard before and after is of another time.
    """

    def __init__(self, name: str, heard_s: np.ndarray, own_s: np.ndarray, begin_s: float) -> None:
        self.name = name
        self.has_jumped = False
        self._heard, self._own, self._begin = heard_s, own_s, begin_s
        self.heard_at_0 = float(heard_s[0] - own_s[0] + begin_s)

    @classmethod
    def of(cls, heard: HeardSystem, remarks: list[str]) -> "_Clock":
        """Find the clock of a log; with a remark if it jumps."""
        stamped = [one for one in heard.kinds if "time_boot_ms" in (layout_of(one).names or ())]
        private = [one for one in stamped if one.startswith("FTC_")]
        name, kinds = ("simulated", private) if private else ("boot", stamped)
        if not kinds:
            times = np.sort(np.concatenate([heard.heard_s(one) for one in heard.kinds]))
            return cls("heard", times, times - times[0], 0.0)
        places = np.concatenate([heard.kinds[one].places for one in kinds])
        own = np.concatenate([np.asarray(heard.own_s(one)) for one in kinds])
        order = np.argsort(places, kind="stable")
        stretch, jumps = longest_stretch(own[order])
        remarks += jumps
        rows = order[stretch]
        own = own[rows]
        begin = 0.0 if name == "simulated" else float(own.min())
        found = cls(name, heard.time_s[places[rows]], np.maximum.accumulate(own), begin)
        found.has_jumped = bool(jumps)
        return found

    def times(self, heard: HeardSystem, name: str) -> tuple[np.ndarray, str]:
        """Return the times of all messages of a kind [s], and their clock; NaN where it is not."""
        heard_s, own = heard.heard_s(name), heard.own_s(name)
        placed = self.placed(heard_s)
        if own is None:
            return placed, "heard"
        is_same = "time_boot_ms" in (layout_of(name).names or ())
        is_same &= name.startswith("FTC_") == (self.name == "simulated")
        if not is_same and np.isfinite(placed).any():
            own = own + np.nanmedian(placed + self._begin - own)
        return np.where(np.isfinite(placed), own - self._begin, np.nan), self.name

    def placed(self, heard_s: np.ndarray, *, whole: bool = False) -> np.ndarray:
        """Return the flight's time when something was heard [s].

        Args:
            heard_s: When, shape (n,) [s].
            whole: What is before and after is at the flight's ends, unless the clock jumps; else it
                is NaN.
        """
        ends = None if whole and not self.has_jumped else np.nan
        order = np.argsort(self._heard, kind="stable")
        own = self._own[order] - self._begin
        return np.asarray(np.interp(heard_s, self._heard[order], own, ends, ends))


def _modes(heard: HeardSystem, clock: _Clock) -> Iterator[tuple[float, str]]:
    if "HEARTBEAT" not in heard.kinds:
        return
    time_s = clock.placed(heard.heard_s("HEARTBEAT"), whole=True).tolist()
    numbers = heard.values("HEARTBEAT")["custom_mode"].tolist()
    last_of = dict(zip(time_s, numbers, strict=True))  # several are at one time
    known = ((at, number) for at, number in last_of.items() if np.isfinite(at))
    for number, same in groupby(known, itemgetter(1)):
        yield next(same)[0], _mode_name(number, heard.heartbeat)


def _mode_name(number: int, heartbeat: Mapping[str, int]) -> str:
    if heartbeat["autopilot"] in {ARDUPILOT, PX4} and not missing(TOOLS_PACKAGES):
        from pymavlink import mavutil

        if heartbeat["autopilot"] == PX4:
            return str(mavutil.interpret_px4_mode(heartbeat["base_mode"], number))
        known = mavutil.mode_mapping_bynumber(heartbeat["type"]) or {}
        return str(known.get(number, f"mode {number}"))
    return MODE_NAMES.get(number, f"mode {number}")


def _texts(heard: HeardSystem, clock: _Clock) -> Iterator[LogText]:
    if "STATUSTEXT" not in heard.kinds:
        return
    time_s = clock.placed(heard.heard_s("STATUSTEXT"), whole=True)
    values, assembler = {**heard.values("STATUSTEXT"), "time_s": time_s}, TextAssembler()
    for at, *fields in rows(values, "time_s", "severity", "text", "id", "chunk_seq"):
        message = dialect.MAVLink_statustext_message(*fields)
        for one in assembler.receive(message, at) if np.isfinite(at) else ():
            yield LogText(at, one.severity, one.text)


def _parameters(heard: HeardSystem) -> dict[str, float]:
    """Return the last value of each parameter; whole numbers of PX4 are sent bit by bit."""
    values = heard.values("PARAM_VALUE")
    if not values:
        return {}
    numbers = np.asarray(values["param_value"], "<f4")
    whole = numbers.view("<i4").astype(float)
    is_whole = values["param_type"] == dialect.MAV_PARAM_TYPE_INT32
    is_whole &= heard.heartbeat.get("autopilot") != ARDUPILOT
    found = np.where(is_whole, whole, numbers.astype(float))
    named = (one.decode("ascii", "replace") for one in values["param_id"].tolist())
    return {visible(name): float(value) for name, value in zip(named, found, strict=True)}

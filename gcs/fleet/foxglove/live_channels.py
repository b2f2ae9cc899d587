"""What a ground station hears, as messages of the channels of `gcs.results.channels`.

No socket and no clock: messages and notifications of a client go in, messages for
Foxglove come out.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

from gcs.results.channels import EVENT, FAULTS, LOCATION, TEXTS, ChannelKind, state_kind
from gcs.results.quantities import QUANTITIES
from gcs.station.fleet_state import FleetState
from gcs.station.notifications import Notification
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, THROTTLE
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults.kinds import FaultLimits

_TRACKED = tuple(
    f"{field}_{name}" for field in ("reference", "error", "sync_error") for name in QUANTITIES
)
_HELD = tuple(f"held_{name}" for name in ACTUATORS)
_SLOT = ("path_position", "slot_ahead", "slot_right", "slot_up")
_MOTION = ("north", "east", "down", "roll", "pitch", "yaw", "p", "q", "r", "V")
STATE = state_kind((*_MOTION, *_TRACKED, *_HELD, *_SLOT))
"""The columns of a recording that vehicles report; null until they have."""

_OF_UAV = (STATE, LOCATION, EVENT, FAULTS)


def all_channels(systems: Iterable[int]) -> list[tuple[ChannelKind, int]]:
    """Return the kind and the system of each channel of a fleet with these system ids."""
    return [*((kind, system) for system in systems for kind in _OF_UAV), (TEXTS, 0)]


Publish: TypeAlias = Callable[[ChannelKind, int, float, Callable[[], Mapping[str, Any]]], None]
"""Called with the kind, the system (0: the fleet), the simulated time [s], and what makes the
message, which need not be called if nobody reads the channel."""

_LEVELS = {  # of foxglove.Log, by MAV_SEVERITY
    **dict.fromkeys(
        (dialect.MAV_SEVERITY_EMERGENCY, dialect.MAV_SEVERITY_ALERT, dialect.MAV_SEVERITY_CRITICAL),
        5,
    ),
    dialect.MAV_SEVERITY_ERROR: 4,
    dialect.MAV_SEVERITY_WARNING: 3,
    dialect.MAV_SEVERITY_NOTICE: 2,
    dialect.MAV_SEVERITY_INFO: 2,
    dialect.MAV_SEVERITY_DEBUG: 1,
}


class LiveChannels:
    """The channels of a fleet that flies.

    Attributes:
        fleet: What the client knows, set before it receives.
    """

    def __init__(self, limits: Mapping[int, FaultLimits], publish: Publish) -> None:
        """Prepare.

        Args:
            limits: Ranges of the actuators of each UAV, by system id; of others nothing is sent.
            publish: Gets the messages.
        """
        self.fleet = FleetState()
        self._limits, self._publish = limits, publish
        self._events: dict[int, tuple[int, ...]] = {}

    def receive(self, message: MAVLink_message) -> None:
        """Process a message, after the client has."""
        system = message.get_srcSystem()
        state = self.fleet.vehicles.get(system)
        if state is None or system not in self._limits:
            return
        match message:
            case dialect.MAVLink_ftc_tracking_message(time_boot_ms=time_ms):
                self._publish(STATE, system, time_ms / 1e3, lambda: self._state(state))
                place = state.latest.get(dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
                if place is not None:
                    self._publish(LOCATION, system, time_ms / 1e3, lambda: _location(place))
            case dialect.MAVLink_ftc_events_message(time_boot_ms=time_ms):
                self._transmitted(state, message, time_ms / 1e3)
                self._publish(FAULTS, system, time_ms / 1e3, lambda: _faults(state))

    def notify(self, notification: Notification) -> None:
        """Process a notification."""
        state = self.fleet.vehicles.get(notification.system)
        time_s = 0.0 if state is None else state.time_s or 0.0
        self._publish(TEXTS, 0, time_s, lambda: _text(notification, time_s))

    def _state(self, state: VehicleState) -> dict[str, float]:
        """Return what is known of a vehicle, with the names of `STATE`; NaN for what is not."""
        values = dict.fromkeys(STATE.fields, math.nan)
        values |= _named(("north", "east", "down"), state.position_m)
        if (attitude := state.latest.get(dialect.MAVLINK_MSG_ID_ATTITUDE)) is not None:
            values |= {name: getattr(attitude, name) for name in ("roll", "pitch", "yaw")}
            rates = (attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)
            values |= _named("pqr", rates)
        values["V"] = math.nan if state.airspeed_m_s is None else state.airspeed_m_s
        for field in ("reference", "error", "sync_error"):
            values |= _named([f"{field}_{name}" for name in QUANTITIES], _si(getattr(state, field)))
        values |= _named(_HELD, self._held(state))
        formation = state.latest.get(dialect.MAVLINK_MSG_ID_FTC_FORMATION)
        if formation is not None and formation.path_id:
            values |= _named(_SLOT, (formation.path_position, *formation.slot))
        return values

    def _held(self, state: VehicleState) -> tuple[float, ...] | None:
        """Return the commands held [rad, N]; None if they are not known."""
        if state.held is None:
            return None
        limits = self._limits[state.system]
        held = []
        for j, share in enumerate(state.held):
            if j == THROTTLE:
                held.append(share * limits.thrust_n)
            else:
                lowest, highest = limits.surfaces_deg[j]
                held.append(math.radians(share * (-lowest if share < 0.0 else highest)))
        return tuple(held)

    def _transmitted(self, state: VehicleState, message: Any, time_s: float) -> None:
        """Publish the newest event of each channel that has new ones."""
        counts = tuple(message.events)
        before = self._events.get(state.system, (0,) * len(counts))
        self._events[state.system] = counts
        for j, (count, earlier) in enumerate(zip(counts, before, strict=True)):
            if count > earlier:

                def event(j: int = j, count: int = count) -> dict[str, Any]:
                    held = self._held(state)
                    value = math.nan if held is None else held[j]
                    return {"actuator": ACTUATORS[j], "value": value, "count": count}

                self._publish(EVENT, state.system, time_s, event)


def _named(names: Any, values: Any) -> dict[str, float]:
    return {} if values is None else dict(zip(names, map(float, values), strict=True))


def _si(values: tuple[float, ...] | None) -> tuple[float, ...] | None:
    """Return an airspeed [m/s] and three angles, from deg to rad."""
    return None if values is None else (values[0], *map(math.radians, values[1:]))


def _location(place: Any) -> dict[str, float]:
    latitude, longitude, altitude = LOCATION.fields
    return {latitude: place.lat / 1e7, longitude: place.lon / 1e7, altitude: place.alt / 1e3}


def _faults(state: VehicleState) -> dict[str, str]:
    active = state.active_faults
    return {
        name: "; ".join(fault.describe() for fault in active if fault.target.name == name) or "none"
        for name in FAULTS.fields
    }


def _text(notification: Notification, time_s: float) -> dict[str, Any]:
    whole = int(time_s)
    return {
        "timestamp": {"sec": whole, "nsec": round((time_s - whole) * 1e9)},
        "level": _LEVELS[notification.severity],
        "message": notification.text,
        "name": f"UAV {notification.system}" if notification.system else "link",
        "file": notification.kind,
        "line": 0,
    }

"""What the latest messages of a vehicle say."""

import math
from typing import Any

from mavlink_defs import dialect
from mavlink_defs.constants import MODE_NAMES
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.system_ids import systems_of

_PHASES = {dialect.FTC_PHASE_HEALTHY, dialect.FTC_PHASE_SUSPECT, dialect.FTC_PHASE_LOST}


class LatestMessages:
    """The last message of each type from one vehicle, and the quantities in them.

    Attributes:
        latest: Last message of each type, by message id; the first one of a vehicle is a HEARTBEAT.
        received_at: Time at which each of them was received [s].
    """

    def __init__(self) -> None:
        self.latest: dict[int, Any] = {}
        self.received_at: dict[int, float] = {}

    @property
    def tells_private(self) -> bool:
        """Whether it streams its private messages."""
        return dialect.MAVLINK_MSG_ID_FTC_EVENTS in self.latest

    @property
    def armed(self) -> bool:
        """Whether it is armed, by its HEARTBEAT."""
        return bool(self._heartbeat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def mode(self) -> str:
        """Its mode, such as "AUTO"; the number of an unknown mode."""
        return mode_name(self._heartbeat)

    @property
    def is_ready(self) -> bool:
        """Whether it is armed or can be: its HEARTBEAT says STANDBY or ACTIVE."""
        return self._heartbeat.system_status in {
            dialect.MAV_STATE_STANDBY,
            dialect.MAV_STATE_ACTIVE,
        }

    @property
    def airspeed_m_s(self) -> float | None:
        """Airspeed [m/s]."""
        return self._field(dialect.MAVLINK_MSG_ID_VFR_HUD, "airspeed")

    @property
    def attitude_deg(self) -> tuple[float, float, float] | None:
        """Roll, pitch, yaw [deg]."""
        message = self.latest.get(dialect.MAVLINK_MSG_ID_ATTITUDE)
        if message is None:
            return None
        return (math.degrees(message.roll), math.degrees(message.pitch), math.degrees(message.yaw))

    @property
    def position_m(self) -> tuple[float, float, float] | None:
        """North, east, down [m]."""
        message = self.latest.get(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        return None if message is None else (message.x, message.y, message.z)

    @property
    def reference(self) -> tuple[float, ...] | None:
        """Filtered reference: airspeed [m/s], roll, pitch, yaw [deg]."""
        return self._four(dialect.MAVLINK_MSG_ID_FTC_TRACKING, "reference")

    @property
    def error(self) -> tuple[float, ...] | None:
        """Actual minus reference: airspeed [m/s], roll, pitch, yaw [deg]."""
        return self._four(dialect.MAVLINK_MSG_ID_FTC_TRACKING, "error")

    @property
    def sync_error(self) -> tuple[float, ...] | None:
        """Synchronisation error (31), (32): airspeed [m/s], roll, pitch, yaw [deg]."""
        return self._four(dialect.MAVLINK_MSG_ID_FTC_TRACKING, "sync_error")

    @property
    def held(self) -> tuple[float, ...] | None:
        """Commands held: aileron, elevator, rudder, throttle, as shares of their limits."""
        return self._four(dialect.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS, "actuator")

    @property
    def diagnosis(self) -> tuple[float, ...] | None:
        """FTC_PHASE of each actuator; None while nothing is known, or under a law without any."""
        phases = self._four(dialect.MAVLINK_MSG_ID_FTC_DIAGNOSIS, "phase")
        return phases if phases is not None and _PHASES.issuperset(phases) else None

    @property
    def drops(self) -> dict[str, dict[str, int]] | None:
        """Datagrams that it and the plant dropped, by link and reason; None before FTC_DROPS."""
        message = self.latest.get(dialect.MAVLINK_MSG_ID_FTC_DROPS)
        if message is None:
            return None
        links = ("gcs", "formation", "simulator", "plant")
        reasons = [reason.text for reason in DropReason]
        reported = {link: zip(reasons, getattr(message, link), strict=True) for link in links}
        return {link: {reason: n for reason, n in ns if n} for link, ns in reported.items()}

    @property
    def fleet(self) -> frozenset[int]:
        """System ids of its fleet, its own included; empty if it has not reported it."""
        message = self.latest.get(dialect.MAVLINK_MSG_ID_FTC_FLEET)
        return frozenset() if message is None else systems_of(message.members)

    @property
    def _heartbeat(self) -> Any:
        return self.latest[dialect.MAVLINK_MSG_ID_HEARTBEAT]  # the first message of a vehicle

    def _field(self, number: int, name: str) -> float | None:
        message = self.latest.get(number)
        return None if message is None else float(getattr(message, name))

    def _four(self, number: int, name: str) -> tuple[float, ...] | None:
        message = self.latest.get(number)
        return None if message is None else tuple(getattr(message, name)[:4])


def mode_name(heartbeat: Any) -> str:
    """Return the mode in a HEARTBEAT, such as "AUTO"; the number of an unknown mode.

    "-" is an unknown one of no autopilot, as in the replay of a log whose modes are not ours.
    """
    is_known = heartbeat.autopilot != dialect.MAV_AUTOPILOT_INVALID
    return MODE_NAMES.get(heartbeat.custom_mode, str(heartbeat.custom_mode) if is_known else "-")

"""The known state of one vehicle.

No socket and no clock: messages and the time go in, notifications come out. Times are on the
client's clock [s] unless they are called simulated time.
"""

import math
from collections import deque
from typing import Any

from gcs.station.event_counts import EventCounts
from gcs.station.history import History
from gcs.station.latest_messages import LatestMessages, mode_name
from gcs.station.mission import Mission, is_same, profile_of
from gcs.station.notifications import ERROR, INFO, NOTICE, WARNING, Kind, Notification, enum_name
from gcs.station.telemetry import PRIVATE, ReportedClock
from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults import COMMANDS as FAULT_COMMANDS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.profile import Segment
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.statustext import Text, TextAssembler

LOST_S = 2.0
"""Silence after which the link to a vehicle counts as lost."""

_RATE_WINDOW_S = 2.0
_FAULTS_REFRESH_S = 5.0
_PROFILE_REFRESH_S = 30.0
_PRIVATE_PATIENCE_S = 5.0
_TRY_AGAIN_S = 2.0
_TEXTS_KEPT = 500
_UNREPORTED = {dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL}
_ACKED = {dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS}


class VehicleState(LatestMessages):
    """One vehicle, from its first HEARTBEAT on.

    Attributes:
        address: Its system and component id.
        heard_at: Time at which anything was last received.
        lost: Whether it has been silent for `LOST_S`.
        restarts: Restarts since it was first heard.
        counts: Its event counters.
        history: Its telemetry, for plots.
        texts: Its last STATUSTEXTs, oldest first.
        faults: Its faults, including past and future ones; None until it has listed them.
        mission: The items of its mission, home included; None until it was downloaded.
        profile: The segments of its profile, empty if its mission is none; None as above.
        areas: Fence and rally points, items by MAV_MISSION_TYPE, as far as they were downloaded.
        offers_faults: Whether it answers requests for its faults; True until it refuses.
        offers_profile: The same for its profile.
        offers_areas: The same for its fence and rally points.
        offers_private: The same for the streams of its private messages.
    """

    def __init__(self, address: SystemId, now: float) -> None:
        super().__init__()
        self.address = address
        self.heard_at = now
        self.lost = False
        self.restarts = 0
        self.texts: deque[Text] = deque(maxlen=_TEXTS_KEPT)
        self.texts_heard = 0
        self.offers_faults = self.offers_profile = self.offers_private = True
        self.offers_areas = True
        self._assembler = TextAssembler()
        self._arrivals: deque[float] = deque()
        self._forget(now)

    def _forget(self, now: float) -> None:
        """Discard everything that belongs to the previous run of the vehicle."""
        self.counts = EventCounts()
        self.history = History()
        self.faults: tuple[Fault, ...] | None = None
        self.mission: Mission | None = None
        self.profile: tuple[Segment, ...] | None = None
        self.areas: dict[int, Mission] = {}
        self.faults_due = self.profile_due = self.private_due = self.areas_due = now
        self._boot, self._simulated = ReportedClock(), ReportedClock()

    # input: messages and time

    def receive(self, message: MAVLink_message, now: float) -> list[Notification]:
        """Process a message of the vehicle."""
        notifications = self.note_heard(now)
        if self._is_another_run(message, now):
            self.restarts += 1
            self._forget(now)
            notifications.append(self._notifications(now, "link", WARNING, "vehicle was restarted"))
        number = message.get_msgId()
        before = self.latest.get(number)
        self.latest[number], self.received_at[number] = message, now
        match message:
            case dialect.MAVLink_heartbeat_message():
                notifications += self._mode_changes(before, now)
            case dialect.MAVLink_statustext_message():
                notifications += self._said(self._assembler.receive(message, now), now)
            case dialect.MAVLink_ftc_events_message():
                self.counts.receive(message)
                self.private_due = now + _PRIVATE_PATIENCE_S
            case dialect.MAVLink_ftc_tracking_message():
                self._remember(message)
            case dialect.MAVLink_mission_current_message(total=total):
                if before is not None and before.total != total:
                    self.profile_due = now  # uploaded by a station whose answers we do not receive
            case dialect.MAVLink_command_ack_message():
                notifications += self._acknowledged(message, now)
            case dialect.MAVLink_mission_ack_message():
                notifications += self._mission_acknowledged(message, now)
        return notifications

    def note_heard(self, now: float) -> list[Notification]:
        """Note that something was received from it."""
        notifications = []
        if self.lost:
            self.lost = False
            silence = f"link back after {now - self.heard_at:.1f} s"
            notifications.append(self._notifications(now, "link", NOTICE, silence))
            self.faults_due = self.profile_due = self.private_due = self.areas_due = now
        self.heard_at = now
        self._arrivals.append(now)
        return notifications

    def handle_timer(self, now: float) -> list[Notification]:
        """Detect a lost link and texts that stay incomplete; call it often."""
        notifications = self._said(self._assembler.handle_timer(now), now)
        while self._arrivals and self._arrivals[0] < now - _RATE_WINDOW_S:
            self._arrivals.popleft()
        if not self.lost and now - self.heard_at >= LOST_S:
            self.lost = True
            text = f"link lost: silent for {now - self.heard_at:.1f} s"
            notifications.append(self._notifications(now, "link", ERROR, text))
        return notifications

    def learn_faults(self, faults: tuple[Fault, ...] | None, now: float) -> list[Notification]:
        """Record its answer to a request for its faults; None if there was none."""
        self.faults_due = now + (_TRY_AGAIN_S if faults is None else _FAULTS_REFRESH_S)
        before = self.faults
        if faults is None or faults == before:
            return []
        self.faults = faults
        text = "; ".join(fault.describe() for fault in faults) or "none"
        if before is None and not faults:
            return []
        return [self._notifications(now, "faults", NOTICE, f"faults: {text}", faults)]

    def learn_mission(self, mission: Mission | None, now: float) -> list[Notification]:
        """Record its answer to a request for its mission; None if there was none."""
        self.profile_due = now + (_TRY_AGAIN_S if mission is None else _PROFILE_REFRESH_S)
        if mission is None or (self.mission is not None and is_same(mission, self.mission)):
            return []
        self.mission, profile = mission, profile_of(mission)
        self.profile = profile or ()
        text = f"profile of {len(self.profile)} segments" if profile else "no profile"
        if profile is None:
            text = f"mission of {len(mission) - 1} items"
        return [self._notifications(now, "profile", INFO, f"holds {text}", self.profile)]

    def learn_areas(
        self, mission_type: int, items: Mission | None, now: float
    ) -> list[Notification]:
        """Record its answer to a request for fence or rally points; None if there was none."""
        self.areas_due = now + (_TRY_AGAIN_S if items is None else _PROFILE_REFRESH_S)
        if items is None:
            return []
        before, self.areas[mission_type] = self.areas.get(mission_type, ()), items
        if is_same(items, before, first=0):
            return []
        what = "fence" if mission_type == dialect.MAV_MISSION_TYPE_FENCE else "rally points"
        text = f"holds {what} of {counted(len(items), 'item')}" if items else f"holds no {what}"
        return [self._notifications(now, "profile", INFO, text)]

    def learn_private(self, now: float) -> None:
        """Record that its private messages were requested."""
        self.private_due = now + _PRIVATE_PATIENCE_S

    # output: the known state

    @property
    def system(self) -> int:
        """Its system id."""
        return self.address.system

    def is_asking_due(self, now: float) -> bool:
        """Return whether to request faults, profile, or fence and rally points (again)."""
        faults = self.offers_faults and now >= self.faults_due
        profile = self.offers_profile and now >= self.profile_due
        areas = self.offers_areas and now >= self.areas_due
        return not self.lost and (faults or profile or areas)

    def is_private_due(self, now: float) -> bool:
        """Return whether to request the streams of its private messages (again)."""
        return not self.lost and self.offers_private and now >= self.private_due

    def texts_since(self, heard: int) -> list[Text]:
        """Return the texts received since `texts_heard` was `heard`, as far as they are stored."""
        new = min(self.texts_heard - heard, len(self.texts))
        return list(self.texts)[len(self.texts) - new :]

    def age_s(self, now: float) -> float:
        """Return the time since anything was received from it [s]."""
        return max(now - self.heard_at, 0.0)

    def rate_hz(self, now: float) -> float:
        """Return messages per second of wall-clock time over the last two seconds."""
        return sum(at >= now - _RATE_WINDOW_S for at in self._arrivals) / _RATE_WINDOW_S

    @property
    def time_s(self) -> float | None:
        """Simulated time of its newest private message [s]; None before the first one."""
        newest_ms = self._simulated.newest_ms
        return None if newest_ms < 0 else newest_ms / 1e3

    @property
    def active_faults(self) -> tuple[Fault, ...]:
        """The faults that are active now, in simulated time."""
        time_s = self.time_s or 0.0
        return tuple(f for f in self.faults or () if f.window.contains(time_s))

    # internals

    def _notifications(
        self, now: float, kind: Kind, severity: int, text: str, about: Any = None
    ) -> Notification:
        return Notification(now, self.system, kind, severity, text, about)

    def _is_another_run(self, message: MAVLink_message, now: float) -> bool:
        """Return whether the vehicle has been started again.

        It boots, its step counter fell while time advanced, or its time since boot or simulated
        time, which private messages carry, went back and stays back.
        """
        if isinstance(message, dialect.MAVLink_heartbeat_message):
            before = self.latest.get(dialect.MAVLINK_MSG_ID_HEARTBEAT)
            boots = message.system_status == dialect.MAV_STATE_BOOT
            return boots and before is not None and before.system_status != message.system_status
        time_ms = getattr(message, "time_boot_ms", None)
        if time_ms is None:
            return False
        clock = self._simulated if message.get_msgId() in PRIVATE else self._boot
        if clock.goes_back(time_ms, now):
            return True
        return (
            isinstance(message, dialect.MAVLink_ftc_events_message)
            and time_ms >= self.counts.time_s * 1e3
            and message.steps < self.counts.steps
        )

    def _mode_changes(self, before: Any, now: float) -> list[Notification]:
        heartbeat = self._heartbeat
        if before is None:
            return []
        notifications = []
        flag = dialect.MAV_MODE_FLAG_SAFETY_ARMED
        if (heartbeat.base_mode ^ before.base_mode) & flag:
            text = "armed" if self.armed else "disarmed"
            notifications.append(self._notifications(now, "mode", NOTICE, text))
        if heartbeat.custom_mode != before.custom_mode:
            text = f"mode {mode_name(before)} → {self.mode}"
            notifications.append(self._notifications(now, "mode", NOTICE, text))
        return notifications

    def _said(self, texts: list[Text], now: float) -> list[Notification]:
        self.texts.extend(texts)
        self.texts_heard += len(texts)
        return [self._notifications(now, "text", text.severity, text.text, text) for text in texts]

    def _remember(self, message: dialect.MAVLink_ftc_tracking_message) -> None:
        nothing = (math.nan,) * 4
        events = self.latest.get(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
        actual = tuple(a + b for a, b in zip(message.reference, message.error, strict=True))
        if math.isnan(actual[0]):  # disarmed, or a log of others: no reference
            airspeed = math.nan if self.airspeed_m_s is None else self.airspeed_m_s
            actual = (airspeed, *(self.attitude_deg or actual[1:]))
        self.history.add(
            (
                message.time_boot_ms / 1e3,
                actual,
                tuple(message.reference),
                tuple(message.sync_error),
                self.held or nothing,
                self.counts.events,
                nothing if events is None else tuple(events.predicted_exit),
                self.position_m or nothing[:3],
            )
        )

    def _acknowledged(
        self, message: dialect.MAVLink_command_ack_message, now: float
    ) -> list[Notification]:
        accepted = message.result == dialect.MAV_RESULT_ACCEPTED
        if accepted and message.command in FAULT_COMMANDS:
            self.faults_due = now
        if message.result in _ACKED and message.command in _UNREPORTED:
            return []
        result = enum_name("MAV_RESULT", message.result, "MAV_RESULT_")
        text = f"{enum_name('MAV_CMD', message.command, 'MAV_CMD_')}: {result}"
        severity = INFO if message.result in _ACKED else WARNING
        return [self._notifications(now, "ack", severity, text, message)]

    def _mission_acknowledged(
        self, message: dialect.MAVLink_mission_ack_message, now: float
    ) -> list[Notification]:
        accepted = message.type == dialect.MAV_MISSION_ACCEPTED
        if accepted and message.mission_type == dialect.MAV_MISSION_TYPE_MISSION:
            self.profile_due = now
        elif accepted:
            self.areas_due = now
        text = f"mission: {enum_name('MAV_MISSION_RESULT', message.type, 'MAV_MISSION_')}"
        return [self._notifications(now, "ack", INFO if accepted else WARNING, text, message)]

"""Flight modes of a vehicle: arming, the mode, the profile's clock, set-points.

Decisions reach the controller through its guidance and profile, between two steps. What can be
refused returns a MAV_RESULT, and sends the reason as a STATUSTEXT.
"""

import math
from collections.abc import Callable, Sequence

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import restart_law
from ftc_autopilot.control.controllers import NOT_STARTED, Controllers, Source
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.hot_state import HotState
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, FORCE_DISARM, GUIDED, LOITER, MODE_NAMES
from mavlink_defs.profile import items_to_segments
from mavlink_defs.services.mission import MissionItem

__all__ = ["Modes", "Say"]

Say = Callable[[int, str], None]
"""Announces a text, with its MAV_SEVERITY."""

_ACCEPTED, _DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


class Modes:
    """Modes and arming of one vehicle.

    Attributes:
        mode: custom_mode in force.
        armed: Whether the controller runs, or will from the first step on.
        airspeeds: Range of airspeed commands accepted.
    """

    def __init__(
        self, config: AutopilotConfig, hot: HotState, controllers: Controllers, say: Say
    ) -> None:
        self.mode = LOITER
        self.armed = False
        self.airspeeds = config.aircraft.airspeed_limits
        self._hot, self._controllers, self._say = hot, controllers, say
        self._guidance = controllers.guidance[0]
        self._autopilot = config.mav_autopilot

    # state

    @property
    def running(self) -> bool:
        """Whether simulated time runs."""
        return self._hot.running

    @property
    def status(self) -> int:
        """MAV_STATE: BOOT until a state is received from the simulator."""
        if self._hot.heard_s == 0.0:
            return dialect.MAV_STATE_BOOT
        return dialect.MAV_STATE_ACTIVE if self.armed else dialect.MAV_STATE_STANDBY

    @property
    def has_profile(self) -> bool:
        """Whether there is a profile to fly."""
        return bool(self._controllers.profiles[0]["count"] > 0)

    @property
    def started(self) -> bool:
        """Whether MAV_CMD_MISSION_START was given."""
        return bool(self._guidance["start_step"] != NOT_STARTED)

    @property
    def flies_profile(self) -> bool:
        """Whether the profile gives the references now."""
        return bool(self._guidance["follows"] == Source.PROFILE) and self.running

    def heartbeat(self) -> dialect.MAVLink_heartbeat_message:
        """Return a HEARTBEAT with mode, arming and state."""
        flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
        flags |= dialect.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode != LOITER else 0
        flags |= dialect.MAV_MODE_FLAG_AUTO_ENABLED if self.mode == AUTO else 0
        flags |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_FIXED_WING, self._autopilot, flags, self.mode, self.status, 3
        )

    # the profile

    def take_profile(self, items: Sequence[MissionItem]) -> None:
        """Put a mission, checked before, in force; home alone or nothing clears the profile."""
        if len(items) < 2:
            self._controllers.profiles[0]["count"] = 0
            self._guidance["start_step"] = NOT_STARTED
            if self.mode == AUTO:
                self._enter(LOITER)
            return
        segments = items_to_segments(items, self.airspeeds)
        self._controllers.profiles[0] = profile_record(segments)
        text = f"profile of {len(segments)} segments in force"
        if self.flies_profile:
            text += f", segment {self.current_item()} at {self._elapsed_s():.3f} s of the mission"
            if self.is_over():
                text += "; to fly it from its start, start the mission again"
        self._say(dialect.MAV_SEVERITY_INFO, text)

    def current_item(self) -> int:
        """Return the number of the mission item whose segment the next mission step flies."""
        profile, elapsed_s = self._controllers.profiles[0], self._elapsed_s()
        return 1 + sum(
            elapsed_s >= float(start) for start in profile["start"][1 : int(profile["count"])]
        )

    def is_over(self) -> bool:
        """Return whether the last segment, which has no end, is being flown."""
        return self.started and self.current_item() == int(self._controllers.profiles[0]["count"])

    def jump_to(self, seq: int) -> None:
        """Let a started mission go on with item seq, as if its segment began now."""
        if self.started and 1 <= seq != self.current_item():
            self._guidance["start_step"] = self._hot.step - self._steps_to(seq)

    # commands: params are those of the MAV_CMD

    def arm_or_disarm(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_COMPONENT_ARM_DISARM."""
        if params[0] not in {0.0, 1.0}:
            return self._refuse(f"Arm: param 1 is {params[0]:g}, must be 0 or 1")
        if params[0] == 1.0:
            if self.status == dialect.MAV_STATE_BOOT:
                self._refuse("Arm: no state from the simulator yet")
                return dialect.MAV_RESULT_TEMPORARILY_REJECTED
            if not self.armed:
                restart_law(self._controllers.states[0])
                self._set_armed(True)
                self._enter(self.mode)
        elif self.armed:
            if self.running and params[1] != FORCE_DISARM:
                return self._refuse(
                    f"Disarm: refused in flight; force it with param 2 = {FORCE_DISARM:g}"
                )
            self._set_armed(False)
        return _ACCEPTED

    def start_mission(self, seq: int = 1) -> int:
        """Execute MAV_CMD_MISSION_START of the whole mission.

        Args:
            seq: Item to begin with.
        """
        if not self.has_profile:
            return self._refuse("Mission start: no profile uploaded")
        if self.running and not self.armed:
            return self._refuse("Mission start: not armed")
        first = self._hot.step + 1 if self.running else 0
        self._guidance["start_step"] = first - (self._steps_to(seq) if seq > 1 else 0)
        self._enter(AUTO)
        return _ACCEPTED

    def set_mode(self, mode: float) -> int:
        """Execute MAV_CMD_DO_SET_MODE; `mode` is the custom_mode."""
        if mode not in MODE_NAMES:
            names = ", ".join(f"{name} ({number})" for number, name in MODE_NAMES.items())
            return self._refuse(f"Mode {mode:g}: must be {names}")
        if mode == AUTO and not self.has_profile:
            return self._refuse("Mode AUTO: no profile uploaded")
        self._enter(int(mode))
        return _ACCEPTED

    def change_speed(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_DO_CHANGE_SPEED: param 2 is the airspeed [m/s]."""
        if self._guidance["follows"] == Source.PROFILE:
            return self._refuse("Change speed: not while a profile is flown")
        low, high = self.airspeeds.min_m_s, self.airspeeds.max_m_s
        if not low <= params[1] <= high:
            return self._refuse(f"Speed is {params[1]:g} m/s, must be {low:g} to {high:g} m/s")
        self._guidance["command"][0] = params[1]
        return _ACCEPTED

    def set_attitude_target(self, message: dialect.MAVLink_set_attitude_target_message) -> None:
        """Follow an attitude set-point in GUIDED; its quaternion is body to NED, scalar first."""
        if self.mode != GUIDED:
            return
        w, x, y, z = map(float, message.q)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not 0.9 < length < 1.1 or message.type_mask & (
            dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        ):
            return
        w, x, y, z = w / length, x / length, y / length, z / length
        self._guidance["command"][1:] = (
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )

    def restart(self) -> None:
        """Return to the initial state, for another flight: disarmed, in LOITER."""
        self._set_armed(False)
        self._enter(LOITER)

    def resume(self, mode: int) -> None:
        """Take up the mode and the arming of a life before, as the records have them."""
        self.mode, self.armed = mode, bool(self._guidance["active"])

    # inside

    def _set_armed(self, armed: bool) -> None:
        self.armed = armed
        self._controllers.actuators[0]["mode"] = dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self._guidance["active"] = int(armed)

    def _elapsed_s(self) -> float:
        """Return the time since the start of the mission [s]."""
        steps = self._hot.step - int(self._guidance["start_step"])
        return steps * self._hot.step_us / 1e6

    def _steps_to(self, seq: int) -> int:
        """Return the steps from the start of the mission to the segment of an item."""
        start_s = float(self._controllers.profiles[0]["start"][seq - 1])
        return math.ceil(start_s * 1e6 / self._hot.step_us)

    def _enter(self, mode: int) -> None:
        """Change the mode; a mode that does not fly the profile continues straight and level."""
        flies_profile = mode == AUTO and self.started
        self._guidance["follows"] = Source.PROFILE if flies_profile else Source.COMMAND
        if not flies_profile:
            state = self._hot.measured
            speed = math.hypot(*map(float, state["velocity"] - state["wind"]))
            airspeed = min(max(speed, self.airspeeds.min_m_s), self.airspeeds.max_m_s)
            self._guidance["command"] = (airspeed, 0.0, 0.0, float(state["attitude"][2]))
        if mode != self.mode:
            self.mode = mode
            self._say(dialect.MAV_SEVERITY_INFO, f"mode {MODE_NAMES[mode]}")

    def _refuse(self, text: str) -> int:
        self._say(dialect.MAV_SEVERITY_WARNING, text)
        return _DENIED

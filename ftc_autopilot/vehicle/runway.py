"""Take-off and landing of a vehicle: what it tells of them, and the commands for them."""

from collections.abc import Iterator

from ftc_autopilot.guidance.runway import STANDS
from ftc_autopilot.guidance.runway_state import (
    AIRSPEED,
    AROUND,
    ASKED,
    BANKED,
    CLIMBING,
    FINAL,
    FLARE,
    NO_THRUST,
    OFF_LINE,
    OFF_SLOPE,
    REJECTED,
    ROLL_OUT,
    ROLLING,
    SINKING,
    STANDING,
    STOPPED,
    TOO_LONG,
    is_glide,
)
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.modes import Modes, Say
from ftc_autopilot.vehicle.shown_state import ShownState
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.runtime.jit import in_python
from sitl_plant.vec3 import norm

_is_glide = in_python(is_glide)
_TEXTS = {
    ROLLING: "take-off",
    CLIMBING: "off the ground",
    REJECTED: "take-off rejected: {}",
    FINAL: "final approach",
    FLARE: "flare",
    ROLL_OUT: "touchdown",
    STOPPED: "stands on the runway",
    AROUND: "going around: {}",
}
_REASONS = {
    NO_THRUST: "too little thrust",
    OFF_LINE: "off the centre line",
    OFF_SLOPE: "off the slope",
    BANKED: "banked",
    SINKING: "sinking too fast",
    AIRSPEED: "airspeed",
    TOO_LONG: "too far along the runway",
    ASKED: "commanded",
}
_STATES = {
    STANDING: dialect.MAV_LANDED_STATE_ON_GROUND,
    ROLLING: dialect.MAV_LANDED_STATE_TAKEOFF,
    CLIMBING: dialect.MAV_LANDED_STATE_TAKEOFF,
    REJECTED: dialect.MAV_LANDED_STATE_ON_GROUND,
    FINAL: dialect.MAV_LANDED_STATE_LANDING,
    FLARE: dialect.MAV_LANDED_STATE_LANDING,
    ROLL_OUT: dialect.MAV_LANDED_STATE_ON_GROUND,
    STOPPED: dialect.MAV_LANDED_STATE_ON_GROUND,
}
_ACCEPTED, _DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


class RunwayMessages:
    """Tells which phase a take-off or landing is in, and disarms when it is over."""

    def __init__(self, shown: ShownState, modes: Modes, say: Say):
        """Note nothing yet.

        Args:
            shown: The last state.
            modes: The vehicle's modes.
            say: Announces a text.
        """
        self._shown, self._modes, self._say = shown, modes, say
        self._phase = modes.path.phase

    @message(dialect.MAVLink_extended_sys_state_message, every_s=1.0)
    def extended_sys_state(self) -> MAVLink_message:
        """Return EXTENDED_SYS_STATE."""
        state = dialect.MAV_LANDED_STATE_IN_AIR
        if not self._modes.armed and self._is_slow:
            state = dialect.MAV_LANDED_STATE_ON_GROUND
        elif self._modes.armed:
            state = _STATES.get(self._modes.path.phase, state)
        return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, state)

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call; a flight that stands again is over."""
        path = self._modes.path
        before, self._phase = self._phase, path.phase
        if before == self._phase:
            return
        if self._phase in _TEXTS:
            text = _TEXTS[self._phase].format(_REASONS.get(path.reason, ""))
            good = self._phase not in (REJECTED, AROUND)
            severity = dialect.MAV_SEVERITY_INFO if good else dialect.MAV_SEVERITY_WARNING
            yield Change(text, severity, text)
        if self._phase == STOPPED:
            self._modes.set_armed(False)

    def go_around(self, _: tuple[float, ...]) -> int:
        """Execute MAV_CMD_DO_GO_AROUND: climb, and fly the approach again."""
        if self._modes.path.phase not in (FINAL, FLARE):
            return self._refuse("Go around: no approach is flown")
        if _is_glide(self._modes.path.record):
            return self._refuse("Go around: there is no thrust for it")
        self._modes.path.go_around()
        return _ACCEPTED

    @property
    def _is_slow(self) -> bool:
        runway = self._modes.path.planner.limits.runway
        stall = 0.0 if runway is None else runway.stall
        return self._shown.airspeed < stall and norm(self._shown.velocity_ned) < STANDS * stall

    def _refuse(self, text: str) -> int:
        self._say(dialect.MAV_SEVERITY_WARNING, text)
        return _DENIED

"""Flight modes of a vehicle: arming, the mode, the mission's clock.

Decisions reach the controller through its guidance, profile and path, between two steps. What can
be refused returns a MAV_RESULT, and sends the reason as a STATUSTEXT.
"""

import bisect
import math
from collections.abc import Callable, Sequence

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import restart_law
from ftc_autopilot.control.controllers import NOT_STARTED, Controllers, ReferenceSource
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.guidance.mission_items import is_path, landing_start, refusal
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.plugins.loading import calling
from ftc_autopilot.vehicle.flight_path import FlightPath, Way
from mavlink_defs import dialect
from mavlink_defs.constants import (
    AUTO,
    AUTOLAND,
    FORCE_DISARM,
    GUIDED,
    LOITER,
    MODE_NAMES,
    RTL,
    TAKEOFF,
)
from mavlink_defs.profile import ItemError, check_mission, items_to_segments
from mavlink_defs.services.mission import MissionItem

Say = Callable[[int, str], None]
"""Announces a text, with its MAV_SEVERITY."""

_ACCEPTED, _DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
_BY_ITSELF = {AUTO, RTL, TAKEOFF, AUTOLAND}


class Modes:
    """Modes and arming of one vehicle.

    Attributes:
        mode: custom_mode in force.
        armed: Whether the controller runs, or will from the first step on.
        airspeeds: Range of airspeed commands accepted.
        path: What is flown along in space.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        hot: HotState,
        controllers: Controllers,
        path: FlightPath,
        say: Say,
    ) -> None:
        self.mode, self.path = LOITER, path
        self._item = 1  # of the mission's path, to continue with
        self.armed = self._path_is_gone = False
        self.airspeeds = config.aircraft.airspeed_limits
        with calling(type(config.controller), "holds_heading_by_bank"):
            self._by_bank = config.controller.holds_heading_by_bank(config.aircraft)
        self._hot, self._controllers, self._say = hot, controllers, say
        self._guidance = controllers.uavs[0]["guidance"]
        self._autopilot = config.mav_autopilot
        self._take_off_m = self._usual_take_off_m = config.runway_guidance.take_off_m

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
        """Whether the mission is a profile."""
        return bool(self._controllers.uavs[0]["profile"]["count"] > 0)

    @property
    def has_mission(self) -> bool:
        """Whether there is a mission to fly."""
        return self.has_profile or bool(self.path.items)

    @property
    def started(self) -> bool:
        """Whether MAV_CMD_MISSION_START was given."""
        return bool(self._guidance["start_step"] != NOT_STARTED)

    @property
    def is_unplaced(self) -> bool:
        """Whether the vehicle does not know where it is, as it has had no fix yet."""
        return bool(self._guidance["unplaced"])

    @property
    def flies_mission(self) -> bool:
        """Whether profile or path of the mission gives the references now."""
        profile = int(self._guidance["follows"]) == ReferenceSource.PROFILE
        return (profile or self._on_mission_path) and self.running

    @property
    def _on_mission_path(self) -> bool:
        """Whether the path is the mission's, not a circle that waits for its start."""
        return self.mode == AUTO and self.started and self.path.flown

    def heartbeat(self) -> dialect.MAVLink_heartbeat_message:
        """Return a HEARTBEAT with mode, arming and state."""
        flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
        flags |= dialect.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode != LOITER else 0
        flags |= dialect.MAV_MODE_FLAG_AUTO_ENABLED if self.mode in _BY_ITSELF else 0
        flags |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_FIXED_WING, self._autopilot, flags, self.mode, self.status, 3
        )

    # the mission

    def check_mission(self, items: Sequence[MissionItem]) -> None:
        """Check a mission, home included, as it would be flown now.

        Raises:
            ProfileError: It cannot be flown.
        """
        if not is_path(items):
            check_mission(items, self.airspeeds)
            return
        self.path.check(items)
        if self.mode == AUTO and self.started:
            self.path.mission(1, items)

    def take_mission(self, items: Sequence[MissionItem]) -> None:
        """Put a mission, checked before, in force; home alone or nothing clears it."""
        flown, self._item = self.flies_mission, 1
        self._controllers.uavs[0]["profile"]["count"], self.path.items = 0, ()
        if len(items) < 2:
            self._guidance["start_step"] = NOT_STARTED
            if self.mode == AUTO:
                self.enter(LOITER)
            return
        if is_path(items):
            self.path.items = tuple(items)
            text = f"mission of {len(items) - 1} items in force"
        else:
            segments = items_to_segments(items, self.airspeeds)
            self._controllers.uavs[0]["profile"] = profile_record(segments)
            text = f"profile of {len(segments)} segments in force"
            if flown:
                text += f", segment {self.current_item()} at {self._elapsed_s():.3f} s"
                text += " of the mission"
                if self.is_over():
                    text += "; to fly it from its start, start the mission again"
        self._say(dialect.MAV_SEVERITY_INFO, text)
        for remark in self.path.planner.remarks(items, self.path.home.at):
            self._say(dialect.MAV_SEVERITY_INFO, f"mission: {remark}")
        if self.mode == AUTO and self.started:
            self.enter(AUTO)

    def current_item(self) -> int:
        """Return the number of the mission item that the next mission step flies."""
        if not self.has_profile:
            return self.path.item() if self.flies_mission else self._item
        profile = self._controllers.uavs[0]["profile"]
        starts = profile["start"][1 : int(profile["count"])].tolist()
        return 1 + bisect.bisect_right(starts, self._elapsed_s())

    def is_over(self) -> bool:
        """Return whether the end of the mission, which is flown on, has been reached."""
        if not self.has_profile:
            return self.flies_mission and (self.path.is_at_end() or self.path.landed)
        return self.started and self.current_item() == int(
            self._controllers.uavs[0]["profile"]["count"]
        )

    def jump_to(self, seq: int) -> bool:
        """Continue a mission with item seq; a segment counts as begun now.

        Args:
            seq: Number of the item; 0, home, stands for the first one.

        Returns:
            False, and all is as it was, if it cannot be flown from here.
        """
        seq = max(seq, 1)
        if seq == self.current_item():
            return True
        if not self.has_profile and self.flies_mission:
            return self.enter(AUTO, item=seq)
        self._item = seq
        if self.has_profile and self.started:
            self._guidance["start_step"] = self._hot.step - self._steps_to(seq)
        return True

    def move_home(self, home: Home) -> None:
        """Move home, and at once the path of AUTO or RTL that depends on it.

        Raises:
            ItemError: The mission could not be flown then; all is as it was.
        """
        path, way = self.path, None
        if path.items:
            path.check(path.items, home)
        if self._on_mission_path:
            item, airspeed = self._item, None
            if self.running:
                item, airspeed = path.item(), path.point().airspeed
            way = path.mission(item, home=home, airspeed=airspeed)
        elif path.flown and self.mode == RTL:
            way = path.way_home(home)
        moves, path.home.at = home != path.home.at, home
        if moves and way is not None:
            path.begin(way)

    def guide(self, way: Way, mode: int = GUIDED) -> None:
        """Fly along a path in GUIDED, or another mode whose path it is."""
        self.path.begin(way)
        self._note_mode(mode)

    def point(self, attitude: tuple[float, float, float]) -> None:
        """Hold an attitude, roll, pitch, yaw [rad], at the airspeed of the circle left for it."""
        if self.path.flown:
            self._guidance["command"][0] = self.path.point().airspeed
            self._guidance["follows"] = ReferenceSource.COMMAND
        self._guidance["command"][1:] = attitude

    def note_item(self, seq: int) -> None:
        """Note the item that a mission continues with when it is flown again."""
        self._item = max(seq, 1)

    # commands: params are the MAV_CMD's

    def arm_or_disarm(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_COMPONENT_ARM_DISARM."""
        if params[0] not in {0.0, 1.0}:
            return self._refuse(f"Arm: param 1 is {params[0]:g}, must be 0 or 1")
        if params[0] == 1.0:
            if self.status == dialect.MAV_STATE_BOOT:
                self._refuse("Arm: no state from the simulator yet")
                return dialect.MAV_RESULT_TEMPORARILY_REJECTED
            if not self.armed and not self.enter(self.mode, armed=True):
                return _DENIED
            if self._by_bank is not None:
                self._say(dialect.MAV_SEVERITY_INFO, f"heading by bank: {self._by_bank}")
        elif self.armed:
            if self.running and not self.path.stands and params[1] != FORCE_DISARM:
                return self._refuse(
                    f"Disarm: refused in flight; force it with param 2 = {FORCE_DISARM:g}"
                )
            self.set_armed(False)
        return _ACCEPTED

    def start_mission(self, seq: int = 1) -> int:
        """Execute MAV_CMD_MISSION_START of the whole mission.

        Args:
            seq: Item to begin with.
        """
        if not self.has_mission:
            return self._refuse("Mission start: no mission uploaded")
        if self.running and not self.armed:
            return self._refuse("Mission start: not armed")
        first = self._hot.step + 1 if self.running else 0
        steps = self._steps_to(seq) if self.has_profile and seq > 1 else 0
        entered = self.enter(AUTO, item=max(seq, 1), start_step=first - steps)
        return _ACCEPTED if entered else _DENIED

    def set_mode(self, mode: float) -> int:
        """Execute MAV_CMD_DO_SET_MODE; `mode` is the custom_mode."""
        if mode not in MODE_NAMES:
            names = ", ".join(f"{name} ({number})" for number, name in MODE_NAMES.items())
            return self._refuse(f"Mode {mode:g}: must be {names}")
        if mode == AUTO and not self.has_mission:
            return self._refuse("Mode AUTO: no mission uploaded")
        if mode == self.mode and self.path.flown and mode != AUTO:
            return _ACCEPTED  # a circle goes on
        return _ACCEPTED if self.enter(int(mode)) else _DENIED

    def take_off(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_NAV_TAKEOFF: param 7 is the height above home [m]; 0, NaN: usual."""
        height, highest = params[6], self.path.planner.limits.highest_m
        if height == 0.0 or math.isnan(height):
            height = self._usual_take_off_m
        if height > highest:
            return self._refuse(f"Take-off: {height:g} m above home, must be <= {highest:g} m")
        before, self._take_off_m = self._take_off_m, height
        if self.enter(TAKEOFF):
            return _ACCEPTED
        self._take_off_m = before
        return _DENIED

    def land(self, place: tuple[float, float] | None = None) -> int:
        """Fly the landing of the mission; without one, or at a place, land in AUTOLAND.

        Args:
            place: North and east [m].
        """
        begin = landing_start(self.path.items) if place is None else None
        if begin is not None:
            return self.start_mission(begin)
        try:
            self.guide(self.path.landing(self._usual_take_off_m, place), AUTOLAND)
        except ItemError as error:
            return self._refuse(f"Land: {error.reason}")
        return _ACCEPTED

    def change_speed(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_DO_CHANGE_SPEED: param 2 is the airspeed [m/s]."""
        if self._guidance["follows"] == ReferenceSource.PROFILE:
            return self._refuse("Change speed: not while a profile is flown")
        low, high = self.airspeeds.min_m_s, self.airspeeds.max_m_s
        if not low <= params[1] <= high:
            return self._refuse(f"Speed is {params[1]:g} m/s, must be {low:g} to {high:g} m/s")
        if self.path.flown:
            low, high = self.path.planner.airspeeds.min_m_s, self.path.planner.airspeeds.max_m_s
            if not low <= params[1] <= high:
                return self._refuse(
                    f"Speed is {params[1]:g} m/s, must be {low:g} to {high:g} m/s on a path"
                )
            try:
                self.path.change_speed(params[1])
            except ItemError as error:
                return self._refuse(f"Speed is {params[1]:g} m/s: {error.reason}")
        self._guidance["command"][0] = params[1]
        return _ACCEPTED

    def refuse_to(self, command: int) -> int:
        """Refuse a command that no vehicle in the air can execute, with the reason."""
        return self._refuse(refusal(command))

    def restart(self) -> None:
        """Return to the initial state, for another flight: disarmed, in LOITER."""
        self.set_armed(False)
        self._item = 1
        self.enter(LOITER)

    def resume(self, mode: int) -> None:
        """Restore the mode and the arming, as the restored records have them."""
        self.mode, self.armed = mode, bool(self._guidance["active"])
        self._path_is_gone = self.path.flown and self.path.record["count"] == 0
        if self._path_is_gone:  # wings level until the next state
            airspeed = float(self._guidance["command"][0])
            self._guidance["command"][:2] = self._within_limits(airspeed), 0.0
            self._guidance["follows"] = ReferenceSource.COMMAND

    def handle_timer(self) -> None:
        """Fly again, from here, what a resumed flight has lost, when its first state is there."""
        if self._path_is_gone and self._hot.measured["velocity"].any():
            self._path_is_gone = False
            if not self.enter(self.mode):
                self.enter(LOITER)

    # inside

    def set_armed(self, armed: bool) -> None:
        """Arm or disarm at once, also in flight."""
        self.armed = armed
        self._controllers.uavs[0]["actuators"]["mode"] = (
            dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        )
        self._guidance["active"] = int(armed)

    def _elapsed_s(self) -> float:
        """Return the time since the start of the mission [s]."""
        steps = self._hot.step - int(self._guidance["start_step"])
        return steps * self._hot.step_us / 1e6

    def _steps_to(self, seq: int) -> int:
        """Return the steps from the start of the mission to the segment of an item."""
        start_s = float(self._controllers.uavs[0]["profile"]["start"][seq - 1])
        return math.ceil(start_s * 1e6 / self._hot.step_us)

    def enter(
        self,
        mode: int,
        *,
        item: int | None = None,
        start_step: int | None = None,
        armed: bool | None = None,
    ) -> bool:
        """Change the mode, and what goes with it; return False, all as it was, if it cannot be.

        Args:
            mode: custom_mode.
            item: Item of the mission to continue with; None: as before, as with the others.
            start_step: Step at which the mission's clock is 0.
            armed: Whether the vehicle is armed.
        """
        item = self._item if item is None else item
        start_step = int(self._guidance["start_step"]) if start_step is None else start_step
        armed = self.armed if armed is None else armed
        try:
            way = self._way(mode, item, started=start_step != NOT_STARTED, armed=armed)
        except ItemError as error:
            why = error.text if mode == AUTO else error.reason
            self._refuse(f"Mode {MODE_NAMES[mode]}: {why}")
            return False
        self._item, self._guidance["start_step"] = item, start_step
        if armed and not self.armed:
            restart_law(self._controllers.uavs[0]["controller"])
            self._guidance["runway"]["known"] = 0  # it may have come to the ground meanwhile
            self.set_armed(True)
        if way is not None:
            self.path.begin(way)
        elif mode == AUTO and self.started and self.has_profile:
            self._guidance["follows"] = ReferenceSource.PROFILE
        else:
            self._fly_straight()
        self._note_mode(mode)
        return True

    def _way(self, mode: int, item: int, *, started: bool, armed: bool) -> Way | None:
        """Return the path that a mode flies; None for a profile, and while nothing is flown.

        A mode that has nowhere to go circles, at this place and height.
        """
        if mode == AUTO and started and self.has_profile:
            return None
        if mode == AUTO and started and self.path.items:
            return self.path.mission(item)
        if mode == RTL:
            return self.path.way_home()
        if mode == TAKEOFF:
            return self.path.take_off(self._take_off_m)
        if mode == AUTOLAND:
            return self.path.landing(self._usual_take_off_m)
        return self.path.circle_here() if armed else None

    def _note_mode(self, mode: int) -> None:
        if mode != self.mode:
            self.mode = mode
            self._say(dialect.MAV_SEVERITY_INFO, f"mode {MODE_NAMES[mode]}")

    def _fly_straight(self) -> None:
        """Command straight and level flight, as fast as the aircraft is; nothing is armed."""
        self._guidance["follows"] = ReferenceSource.COMMAND
        state = self._hot.measured
        speed = math.hypot(*map(float, state["velocity"] - state["wind"]))
        yaw = float(state["attitude"][2])
        self._guidance["command"] = (self._within_limits(speed), 0.0, 0.0, yaw)

    def _within_limits(self, airspeed: float) -> float:
        return min(max(airspeed, self.airspeeds.min_m_s), self.airspeeds.max_m_s)

    def _refuse(self, text: str) -> int:
        self._say(dialect.MAV_SEVERITY_WARNING, text)
        return _DENIED

"""The slot of an ArduPlane in a formation of ours: where it is, and what brings it there.

Its bridge hears FTC_NEIGHBOUR as a neighbour of ours does, and tells ArduPlane, in GUIDED, a place
to fly to and an airspeed. The place lies far ahead, in the direction of a point of the slot's own
way: ArduPlane turns to it as its L1 controller does to a point of a path at its own distance.
No socket and no clock.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.geography import place_of
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.base import PlantStep
from ftc_autopilot.foreign.slot_way import Arc, Planned, SlotWay, planned
from ftc_autopilot.guidance.slots import SLOT_MOTION, move
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import frame_size
from mavlink_defs.framing.header import COMPONENT, HEADER_SIZE, MESSAGE_ID, PAYLOAD_SIZE, SYSTEM
from mavlink_defs.framing.signing import Signer
from mavlink_defs.runtime.jit import in_python
from mavlink_defs.services.mission import MissionItem
from sitl_plant.foreign.ardupilot.launch import out_of_body
from sitl_plant.foreign.ardupilot.parameters import acceleration
from sitl_plant.vec3 import Vec3

_move = in_python(move)
_PERIOD_S = 0.2
_L1_PERIOD_S, _L1_DAMPING = 17.0, 0.75
"""NAVL1_PERIOD and NAVL1_DAMPING, as ArduPlane has them by default."""
_AHEAD_S = _L1_PERIOD_S / (2.0 * math.pi * _L1_DAMPING)
"""Its acceleration to a far place, 4 d² v² sin η / L1 with L1 = d T v / π, is the one of a path,
2 v² sin η / L, if the point of the path is L = T v / (2 π d) away."""
_FAR_M = 1000.0  # nearer than L1 it would circle about the place
_SPEED_LAG_S = 5.0
"""TECS_TIME_CONST, as ArduPlane has it by default: its airspeed follows as of first order."""
_POLE_1_S = 0.2
"""All three poles of the distance along the path, its integral included, are minus that."""
_TOLERANCE_RAD = math.radians(0.3)
"""Between the direction to go and the one to the last place, before another is sent: with a place
ArduPlane aims at its present height until it next looks, half of the time at 5 Hz."""
_HELD_S = 0.5 * (_PERIOD_S + 0.1)
"""Mean age of a place where ArduPlane turns to it: sent at 5 Hz, looked at with its 10 Hz."""
_BANK_LAG_S = 0.5
"""RLL2SRV_TCONST, as it is given to it: its bank follows as of first order."""
_TURN_LAG_S = 0.3  # of the course rate, which is a difference of courses
_HEIGHT_ONLY = 0xFFFF & ~dialect.POSITION_TARGET_TYPEMASK_Z_IGNORE


@dataclass
class _Neighbour:
    """What one of ours has said."""

    last: np.void | None = None
    before: np.void | None = None  # the one before, of an earlier step

    def at(self, newest: int) -> np.void | None:
        """Return its last message that is of no later step."""
        both = (self.last, self.before)
        return next((one for one in both if one is not None and one["step"] <= newest), None)


class SlotKeeper:
    """Keeps one ArduPlane in its slot.

    Attributes:
        place: Where its slot is on the path [m], and its offset [m]; None while no path is flown.
    """

    def __init__(self, config: AutopilotConfig, signer: Signer | None) -> None:
        """Begin without having heard anybody.

        Args:
            config: Of its bridge, with a formation.
            signer: Of the formation link; None: it is not signed.
        """
        assert config.formation is not None
        self._config, self._signer = config, signer
        self._formation = config.formation
        self._heard = {one.id: _Neighbour() for one in config.neighbours}
        self._period_s = config.step_us / 1e6
        self._due = 1  # step of the next targets
        self._began: int | None = None  # step at which a path was first flown
        self._ordered: Vec3 | None = None
        self._motion: np.void = np.zeros(1, SLOT_MOTION)[0]  # of its slot
        self._moved: int | None = None  # step of that
        self._course: tuple[int, int, float] | None = None  # whose, of which step, and that
        self._turn = 0.0  # rate of the course [rad/s]
        self._integral = 0.0  # of the distance behind the slot [m s]
        self._keeps = False
        self._far: tuple[float, float] | None = None  # north, east of the last place sent [m]
        self._mission: Sequence[MissionItem] = ()
        self._path: np.void | None = None  # of it
        self._m_s2 = acceleration(config.aircraft)
        self.place: tuple[float, Vec3] | None = None

    def plan(self, items: Sequence[MissionItem]) -> None:
        """Take in the mission that it has been given, which the formation flies."""
        if items is not self._mission:
            self._mission, self._path = items, planned(self._config, items) if items else None

    def order(self, slot: Vec3 | None) -> None:
        """Take another slot: ahead, to the right, up [m]; None: the planned one."""
        self._ordered = slot

    def receive(self, datagram: bytes) -> DropReason | None:
        """Take in a datagram of the formation link; return why it is dropped, if it is."""
        size, problem = frame_size(datagram)
        if self._signer is not None:
            problem = self._signer.problem(datagram)
        elif problem is None and size != len(datagram):
            problem = DropReason.BAD_LENGTH
        if problem is not None:
            return problem
        one = self._heard.get(datagram[SYSTEM])
        if one is None or datagram[COMPONENT] != dialect.MAV_COMP_ID_AUTOPILOT1:
            return DropReason.STRANGER
        if int.from_bytes(datagram[MESSAGE_ID:HEADER_SIZE], "little") != codec.MessageId.NEIGHBOUR:
            return DropReason.UNEXPECTED
        payload = datagram[HEADER_SIZE : HEADER_SIZE + datagram[PAYLOAD_SIZE]]
        record = np.frombuffer(payload.ljust(codec.NEIGHBOUR_SIZE, b"\0"), codec.NEIGHBOUR)[0]
        along = record["path_position"], record["path_rate"]
        if not np.isfinite((*record["position"], *record["ground_velocity"], *along)).all():
            return DropReason.OUT_OF_RANGE
        if one.last is not None and one.last["step"] < record["step"]:
            one.before = one.last
        one.last = record
        return None

    def targets(self, sent: PlantStep, lockstep: bool) -> list[MAVLink_message]:
        """Return what ArduPlane is sent at a step; call it at each.

        In lockstep it goes by what was said of the steps before, so that it does not matter which
        of the autopilots is faster.
        """
        newest = sent.step - 1 if lockstep else sent.step
        found = self._neighbour(newest)
        self.place = None
        if found is None:
            if not self._keeps:
                return []
            self._keeps, self._integral = False, 0.0
            self._course = self._far = self._moved = None
            assert sent.state is not None
            return [self._reposition(*sent.state["position"].tolist())]  # it circles there
        system, message = found
        if self._began is None:
            self._began = sent.step
        own, theirs = self._slot(sent.step), self._planned(system, sent.step)
        age_s = (sent.step - int(message["step"])) * self._period_s
        along = float(message["path_position"]) + age_s * float(message["path_rate"])
        self.place = along + own[0], own
        if sent.step < self._due:
            return []
        self._due, self._keeps = sent.step + round(_PERIOD_S / self._period_s), True
        return self._steer(sent, self._way(sent, message, system, theirs))

    def _neighbour(self, newest: int) -> tuple[int, np.void] | None:
        """Return the first neighbour that is heard and flies the path, and its message."""
        silent = round(self._config.neighbour_timeout_s / self._period_s)
        for system, one in self._heard.items():
            message = one.at(newest)
            if message is not None and message["path_id"] and newest - message["step"] <= silent:
                return system, message
        return None

    def _slot(self, step: int) -> Vec3:
        """Return its slot, on its way to another one at the same pace as ours."""
        slot = self._ordered or self._planned(self._config.id, step)
        begins = self._moved is None
        dt = 0.0 if self._moved is None else (step - self._moved) * self._period_s
        _move(slot, self._formation.slot_speed_m_s, dt, begins, self._motion)
        self._moved = step
        ahead, right, up = self._motion["place"].tolist()
        return ahead, right, up

    def _planned(self, system: int, step: int) -> Vec3:
        """Return the planned slot of a member: ahead, to the right, up [m]."""
        assert self._began is not None
        time_s = (step - self._began) * self._period_s
        past = sum(change.at_s <= time_s for change in self._formation.changes)
        return self._formation.plans()[past][system].offset

    def _way(self, sent: PlantStep, message: np.void, system: int, theirs: Vec3) -> SlotWay:
        """Return the way of its slot: beside the path if that is known, else beside an arc."""
        assert sent.state is not None
        assert self.place is not None
        wind = out_of_body(
            tuple(sent.state["wind"].tolist()), tuple(sent.state["attitude"].tolist())
        )
        at, own = self.place
        arc, speed = self._arc(system, message, sent.step, own[2] - theirs[2])
        if self._path is not None and self._path["id"] == message["path_id"]:
            line = Planned(self._path, own[2])
            return SlotWay(line, at, own[1], float(message["path_rate"]), wind[:2])
        ahead = (own[0] - theirs[0]) / (1.0 + arc.curvature * theirs[1])  # on the neighbour's arc
        return SlotWay(arc, ahead, own[1] - theirs[1], speed, wind[:2])

    def _arc(self, system: int, message: np.void, newest: int, up: float) -> tuple[Arc, float]:
        """Return the arc on which a neighbour flies now, and its speed [m/s]."""
        age_s = (newest - int(message["step"])) * self._period_s
        north, east = (message["position"][:2] + age_s * message["ground_velocity"][:2]).tolist()
        speed, course, step = *_polar(message["ground_velocity"]), int(message["step"])
        if self._course is not None and self._course[0] == system and step > self._course[1]:
            dt = (step - self._course[1]) * self._period_s
            rate = wrap(course - self._course[2]) / dt
            self._turn += (1.0 - math.exp(-dt / _TURN_LAG_S)) * (rate - self._turn)
        self._course = system, step, course
        course += age_s * self._turn
        down = float(message["position"][2]) - up
        return Arc(north, east, course, self._turn / max(speed, 1.0), down), speed

    def _steer(self, sent: PlantStep, way: SlotWay) -> list[MAVLink_message]:
        """Return a place and an airspeed that bring it to its slot."""
        state = sent.state
        assert state is not None
        north, east, _ = state["position"].tolist()
        velocity = out_of_body(tuple(state["velocity"].tolist()), tuple(state["attitude"].tolist()))
        speed = math.hypot(*velocity[:2])
        slot_north, slot_east, course = way.at(0.0)
        slot_down = way.line.down(way.ahead_m)
        sin_c, cos_c = math.sin(course), math.cos(course)
        behind = (slot_north - north) * cos_c + (slot_east - east) * sin_c
        pace = way.pace(self._window_s(way))
        closing = pace.speed_m_s - velocity[0] * cos_c - velocity[1] * sin_c
        airspeed = self._airspeed(
            float(np.linalg.norm(state["velocity"] - state["wind"])) + _SPEED_LAG_S * pace.air_m_s2,
            behind + pace.lead_m,
            closing,
        )
        arc = way.arc_at(behind, _HELD_S + _BANK_LAG_S)
        to_north, to_east, _ = arc.at(_AHEAD_S * speed)
        bearing = math.atan2(to_east - east, to_north - north) + _HELD_S * speed * arc.curvature
        orders = [
            self._height(slot_down),
            self._command(dialect.MAV_CMD_GUIDED_CHANGE_SPEED, (0.0, airspeed, 0.0, 0.0)),
        ]
        if self._is_off(north, east, bearing):
            place = north + _FAR_M * math.cos(bearing), east + _FAR_M * math.sin(bearing)
            self._far = place
            orders.insert(
                0, self._reposition(*place, slot_down)
            )  # its height is flown along a slope
        return orders

    def _window_s(self, way: SlotWay) -> float:
        """Return how long ArduPlane takes for what its slot's speed changes by in a turn [s].

        That is what the turn is wider by, and the wind that the path is planned for.
        """
        bend = 0.0
        if self._path is not None:
            bend = float(np.abs(self._path["curvature"][: self._path["count"]]).max())
        change = way.rate_m_s * bend * abs(way.right_m) + self._config.guidance.wind_max_m_s
        return max(change / self._m_s2, _PERIOD_S)

    def _is_off(self, north: float, east: float, bearing: float) -> bool:
        """Return whether the last place is in another direction, or no longer far."""
        if self._far is None:
            return True
        away = self._far[0] - north, self._far[1] - east
        off = wrap(bearing - math.atan2(away[1], away[0]))
        return abs(off) > _TOLERANCE_RAD or math.hypot(*away) < 0.5 * _FAR_M

    def _airspeed(self, now: float, behind: float, closing: float) -> float:
        """Return the airspeed to ask for [m/s].

        Args:
            now: The airspeed that keeps it as it flies [m/s].
            behind: Its distance behind the slot [m].
            closing: How fast that grows [m/s].
        """
        p, lag = _POLE_1_S, _SPEED_LAG_S
        aircraft = self._config.aircraft
        integral = self._integral + _PERIOD_S * behind
        asked = now + 3.0 * p * lag * closing + 3.0 * p * p * lag * behind + p**3 * lag * integral
        airspeed = min(max(asked, aircraft.airspeed_min_m_s), aircraft.airspeed_max_m_s)
        if airspeed == asked or (asked - airspeed) * behind < 0.0:
            self._integral = integral
        return airspeed

    def _reposition(self, north: float, east: float, down: float) -> MAVLink_message:
        place = place_of(self._config.origin, north, east, down)
        params = (-1.0, 0.0, 0.0, math.nan)  # no speed, no change of mode, its radius, clockwise
        where = place.latitude, place.longitude, place.altitude / 1e3
        return self._command(dialect.MAV_CMD_DO_REPOSITION, params, *where)

    def _height(self, down: float) -> MAVLink_message:
        place, to = place_of(self._config.origin, 0.0, 0.0, down), self._to
        frame, height = dialect.MAV_FRAME_GLOBAL_INT, place.altitude / 1e3
        return dialect.MAVLink_set_position_target_global_int_message(
            0, *to, frame, _HEIGHT_ONLY, 0, 0, height, 0, 0, 0, 0, 0, 0, 0, 0
        )

    @property
    def _to(self) -> tuple[int, int]:
        return self._config.id, dialect.MAV_COMP_ID_AUTOPILOT1

    def _command(
        self,
        number: int,
        params: tuple[float, float, float, float],
        x: int = 0,
        y: int = 0,
        z: float = 0.0,
    ) -> MAVLink_message:
        to, frame = self._to, dialect.MAV_FRAME_GLOBAL
        return dialect.MAVLink_command_int_message(*to, frame, number, 0, 0, *params, x, y, z)


def _polar(velocity: np.ndarray) -> tuple[float, float]:
    """Return the speed over ground [m/s] and course [rad] of a velocity, NED."""
    north, east, _ = velocity.tolist()
    return math.hypot(north, east), math.atan2(east, north)

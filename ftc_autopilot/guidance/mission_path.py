"""The path of a mission: lines, turns and circles from its items.

Between two waypoints the path is straight. A turn from one line to the next passes inside the
corner with a radius of 20° of bank, or a smaller one, down to the least that can be flown, if the
lines are short or the waypoint's acceptance radius demands it. Where that is not enough the path
goes over the waypoint, turns after it and flies straight to the next one. A circle is entered
and left on a tangent. After the last waypoint the path is a circle through it, to the right.

An item lasts up to the middle of its turn, where the path is nearest to it; a circle belongs to its
item until it is left. Heights change evenly on the way from one item to the next.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from ftc_autopilot.guidance.corners import Corner, corner_at, rounded
from ftc_autopilot.guidance.legs import Circle, Leg, Pose, approach, tangent_course
from ftc_autopilot.guidance.limits import FlightLimits, tightest_turn, turn_radius
from ftc_autopilot.guidance.mission_items import LAND, TAKEOFF, MissionTarget
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import MAX_COMMANDS, MAX_LEGS, NO_LOOP, PathCommand
from ftc_autopilot.guidance.runway_legs import (
    LEAST_CLIMB_M,
    around_to,
    landing_legs,
    take_off_legs,
    too_short,
)
from ftc_autopilot.guidance.runway_marks import NO_MARKS, RunwayMarks
from ftc_autopilot.guidance.targets import Targets, order_of
from mavlink_defs import dialect
from mavlink_defs.profile import ItemError

_MAX_TURN = math.radians(150.0)
"""Largest turn inside a corner; at a sharper one the path goes over the waypoint [rad]."""
_NO_TURN = 1e-6
"""Smallest turn [rad]."""
_MIN_M = 1e-6
"""Shortest leg [m]."""
_SAME_M = 1e-3
"""Largest difference of two legs that are the same; of their courses, at a radius of 1 km [m]."""


class Start(NamedTuple):
    """Where a path begins, and how; one that stands on the ground has to take off."""

    pose: Pose
    height: float  # [m]
    airspeed: float  # until the mission says another [m/s]
    stands: bool = False


class MissionPath(NamedTuple):
    """Legs, which of them follows the last one, what of them is runway, and what is passed.

    The remarks say what is flown otherwise than the items say.
    """

    legs: tuple[Leg, ...]
    loop: int = NO_LOOP
    marks: RunwayMarks = NO_MARKS
    commands: tuple[PathCommand, ...] = ()
    remarks: tuple[str, ...] = ()


def mission_path(
    mission: Sequence[MissionTarget],
    limits: FlightLimits,
    home: Home,
    start: Start | None = None,
    first: int = 1,
) -> MissionPath:
    """Return the path of a mission.

    Args:
        mission: Its items, decoded.
        limits: What the aircraft can fly.
        home: Where it returns to.
        start: Where the path begins, and from where the first place is approached by an arc and a
            line; None: at home, straight to the first place and at its height.
        first: Item to begin with.

    Raises:
        ItemError: An item cannot be flown, or there is no place to fly to.
    """
    order = order_of(mission, first)
    if not order.visits:
        text = "no waypoint or circle follows"
        raise ItemError(first, dialect.MAV_MISSION_INVALID, text)
    take_off = next((t for t in order.visits[0] if t.item.command == TAKEOFF), None)
    if start is not None:
        begin = (*start.pose[:2], start.height)
        targets = Targets(order, limits, home, begin, start.airspeed)
        builder = _Builder(targets, limits, start, levels=True)
        if start.stands and take_off is not None:
            builder.take_off(take_off._replace(airspeed=start.airspeed))
        return builder.path()
    begin = (home.north_m, home.east_m, home.height_m)
    targets = Targets(order, limits, home, begin, limits.cruise_m_s)
    start = _from_home(targets, begin, limits)
    if take_off is not None and not math.isnan(take_off.height):
        take_off = _high_enough(targets, take_off, home.height_m)
        if order.visits[0][-1].item.command == LAND:
            start = start._replace(height=take_off.height)
    return _Builder(targets, limits, start, levels=False).path()


def _from_home(targets: Targets, begin: tuple[float, ...], limits: FlightLimits) -> Start:
    """Return the start at home, straight to the first place and at its height."""
    first = targets(0)
    assert first is not None
    course = None
    if first.place is not None:
        course = tangent_course(begin, Circle(*first.place, first.radius))
    return Start(Pose(begin[0], begin[1], course or 0.0), first.height, limits.cruise_m_s)


def _high_enough(targets: Targets, take_off: MissionTarget, ground: float) -> MissionTarget:
    """Return a take-off that leads up at least as far as one does from a height [m]."""
    rise = take_off.height - ground
    if rise >= LEAST_CLIMB_M:
        return take_off
    text = f"it leads {rise:.1f} m above the runway, must be >= {LEAST_CLIMB_M:g} m"
    targets.note("take-off", take_off.item, f"{text}, which is flown")
    return take_off._replace(height=ground + LEAST_CLIMB_M)


class _Builder:
    """Makes the legs of one path, from its start on."""

    def __init__(
        self, targets: Targets, limits: FlightLimits, start: Start, *, levels: bool
    ) -> None:
        """Begin.

        Args:
            targets: Where the path leads.
            limits: What the aircraft can fly.
            start: Where it begins.
            levels: Whether it may begin at another height than the start's, so that the first climb
                is not too steep.
        """
        self._target, self._limits = targets, limits
        self._pose, self._height, self._levels = start.pose, start.height, levels
        self._begun: list[Leg] = []  # what follows a corner's middle
        self._circle: MissionTarget | None = None  # what is left
        self._legs: list[Leg] = []
        self._commands: list[PathCommand] = []
        self._marks = NO_MARKS

    def take_off(self, target: MissionTarget) -> None:
        """Begin with a take-off, at least as high as one leads."""
        target = _high_enough(self._target, target, self._height)
        self._legs = take_off_legs(self._pose, self._height, target, self._limits)
        self._pose, self._height, self._levels = self._legs[-1].end, target.height, False
        self._marks = RunwayMarks(climb=len(self._legs), climb_to=target.height)

    def path(self) -> MissionPath:
        """Return the path."""
        begins: list[int] = []  # first leg on the way to each target
        k = 0
        while (target := self._target(k)) is not None:
            begins.append(len(self._legs))
            self._add_way(k, target)
            same = self._target.index_of_same(k)
            if same is not None and self._alike(begins[same], begins[k]):
                return self._made(begins[k], begins[same])
            self._note_commands(target, begins[k])
            self._add_circle(target)
            if len(self._legs) > MAX_LEGS:
                raise self._too_long(target, k, f"{MAX_LEGS} legs")
            if len(self._commands) > MAX_COMMANDS:
                raise self._too_long(target, k, f"{MAX_COMMANDS} commands")
            k += 1
        return self._made(len(self._legs), self._marks.final if self._marks.landing else NO_LOOP)

    def _made(self, count: int, loop: int) -> MissionPath:
        """Return the path of the first legs."""
        legs, commands = tuple(self._legs[:count]), tuple(self._commands)
        return MissionPath(legs, loop, self._marks, commands, tuple(self._target.remarks()))

    def _note_commands(self, target: MissionTarget, begin: int) -> None:
        """Note what is passed on the way to a target, which begins with a leg."""
        length = sum(leg.length_m for leg in self._legs[begin:])
        is_end = target.place is None and math.isinf(target.length)
        for when, item in target.commands:
            at = when.on(math.inf if is_end else length)
            if math.isfinite(at):
                at = at if is_end else min(at, length)
                self._commands.append(PathCommand(begin, at, item))

    def _too_long(self, target: MissionTarget, k: int, most: str) -> ItemError:
        item = target.item.seq
        text = f"the path has more than {most} up to here; shorten the mission"
        if self._target.index_of_same(k) is not None:
            radius = tightest_turn(target.fastest, self._limits)
            text = f"waypoints are too near to go around: turns have a radius >= {radius:.0f} m"
        elif (jump := self._target.jump_to(k)) is not None:
            item = jump
            text = f"with this jump the path has more than {most}; jump less often"
        return ItemError(item, dialect.MAV_MISSION_NO_SPACE, text)

    def _alike(self, i: int, k: int) -> bool:
        """Return whether the path goes on from leg k as from leg i."""
        if k >= len(self._legs):
            return False  # the same place as the one before: no way
        a, b = self._legs[i], self._legs[k]
        turned = math.remainder(a.course_rad - b.course_rad, 2.0 * math.pi)
        return (a.item, a.airspeed_m_s) == (b.item, b.airspeed_m_s) and all(
            abs(difference) < _SAME_M
            for difference in (
                a.north_m - b.north_m,
                a.east_m - b.east_m,
                a.height_m - b.height_m,
                a.length_m - b.length_m,
                1e3 * turned,
                1e6 * (a.curvature_1_m - b.curvature_1_m),
            )
        )

    # the way to a target

    def _add_way(self, k: int, target: MissionTarget) -> None:
        """Add the way to target k, with the first half of the turn there."""
        pieces, self._begun = self._begun, []
        following = self._target(k + 1)
        if target.place is not None:
            pieces += self._way(target)
        if pieces:
            self._pose = pieces[-1].end
        corner = None
        if target.radius == 0.0 and following is not None and pieces:
            corner = corner_at(target, pieces[-1].end.course, following)
        if corner is not None and abs(corner.turn) > _NO_TURN and pieces[-1].curvature_1_m == 0.0:
            radius = self._corner_radius(k, target, corner, pieces[-1].length_m)
            if radius is not None:
                pieces[-1], arc = rounded(pieces[-1], corner, radius)
                first, second = arc.cut(0.5 * arc.length_m)
                pieces.append(first)
                self._begun, self._pose = [second], second.end
        if target.item.command == LAND:
            self._add_landing(target, pieces)
        else:
            self._add_climb(target, pieces)

    def _add_landing(self, target: MissionTarget, pieces: list[Leg]) -> None:
        """Add the way to the line of a landing, the landing, and the way around again."""
        if not pieces or pieces[-1].curvature_1_m != 0.0:
            text = "no straight line leads to it; move the item before away"
            raise ItemError(target.item.seq, dialect.MAV_MISSION_INVALID, text)
        *way, line = pieces
        short = too_short(line, self._height, target, self._limits)
        if short is not None:
            text, length = short
            text += f"; flown over, and around to one of {length:.0f} m"
            self._target.note("approach", target.item, text)
            *around, line = around_to(line, length, turn_radius(target.fastest, self._limits))
            way += around
        self._add(target, way, 0.0)
        final = len(self._legs)
        legs, marks = landing_legs(line, self._height, target, self._limits)
        self._legs += legs
        self._marks = marks._replace(
            climb=self._marks.climb,
            climb_to=self._marks.climb_to,
            final=final,
            landing=final + marks.landing,
            around=final + marks.around,
        )

    def _way(self, target: MissionTarget) -> list[Leg]:
        """Return arc and line to a target from where the path is."""
        assert target.place is not None
        circle = Circle(*target.place, target.radius)
        left, self._circle = self._circle, None
        if left is not None:  # on the tangent, if it is not inside the circle
            side = (math.copysign(1.0, left.radius),)
            way = approach(self._pose, circle, abs(left.radius), side)
            if way is not None:
                return way
        wide = turn_radius(target.fastest, self._limits)

        def loops(way: Sequence[Leg]) -> float:
            return sum(leg.length_m for leg in way) // (math.pi * wide)

        first = approach(self._pose, circle, wide)
        if first is not None and loops(first) == 0.0:
            return first
        # a tighter turn may save a loop
        ways = [first, approach(self._pose, circle, tightest_turn(target.fastest, self._limits))]
        if target.radius != 0.0:
            side = (math.copysign(1.0, target.radius),)
            ways.append(approach(self._pose, circle, abs(target.radius), side))
        return min((way for way in ways if way is not None), key=loops)

    def _corner_radius(
        self, k: int, target: MissionTarget, corner: Corner, length: float
    ) -> float | None:
        """Return the radius of a turn; None if the path is to go over the waypoint.

        Args:
            k: Number of the target.
            target: Where the corner is.
            corner: The corner.
            length: Of the line before it [m].
        """
        following = self._target(k + 1)
        assert following is not None
        wide = self._wide_radius(target, corner, following)
        if wide is None:
            return None
        ends, out = wide * corner.tangent, corner.out
        after = self._target(k + 2)
        next_corner = after and corner_at(following, corner.course, after)
        if after and next_corner and (radius := self._wide_radius(following, next_corner, after)):
            others = radius * next_corner.tangent
            out *= 1.0 if out >= ends + others else ends / (ends + others)
            out -= others if corner.out >= ends + others else 0.0
        radius = min(wide, length / corner.tangent, out / corner.tangent)
        least = tightest_turn(max(target.fastest, following.fastest), self._limits)
        return radius if radius >= least else None

    def _wide_radius(
        self, target: MissionTarget, corner: Corner, following: MissionTarget
    ) -> float | None:
        """Return the radius of a turn if lines are long; None if it must go over the waypoint."""
        if abs(corner.turn) > _MAX_TURN:
            return None
        airspeed = max(target.fastest, following.fastest)
        radius = turn_radius(airspeed, self._limits)
        if target.within > 0.0:
            radius = min(radius, target.within / max(corner.miss, 1e-12))
        return radius if radius >= tightest_turn(airspeed, self._limits) else None

    def _add_climb(self, target: MissionTarget, pieces: list[Leg]) -> None:
        """Add the way to a target, so that its height is reached there, as nearly as can be."""
        length = sum(piece.length_m for piece in pieces)
        reached = target.height
        rise, steepest = reached - self._height, self._limits.climb
        if abs(rise) > steepest * length + _MIN_M:
            needed = abs(rise) / steepest
            if target.radius != 0.0:  # the rest in the circle
                rest = self._into_circle(target, needed - length)
                pieces, length, self._pose = [*pieces, rest], needed, rest.end
            elif self._levels and not self._legs:
                rise = math.copysign(steepest * length, rise)
                self._height = target.height - rise
            else:
                self._note_missed(target, rise, length, needed)
                rise = math.copysign(steepest * length, rise)
                reached = self._height + rise
        climb = rise / length if length > 0.0 else 0.0
        self._add(target, pieces, climb)
        self._height = reached

    def _note_missed(
        self, target: MissionTarget, rise: float, length: float, needed: float
    ) -> None:
        """Note that a target is passed at another height, as its way is too short [m]."""
        missed, side = abs(rise) - self._limits.climb * length, "low" if rise > 0.0 else "high"
        text = f"height changes by {rise:+.4g} m on a way of {length:.4g} m, must be"
        text += f" >= {math.ceil(needed)} m (a circle on the way would do)"
        self._target.note("height", target.item, f"{text}; passed {missed:.4g} m too {side}")

    def _add_circle(self, target: MissionTarget) -> None:
        if target.radius == 0.0:
            return
        piece = self._into_circle(target, target.length)
        self._add(target, [piece], 0.0, there=True)
        self._circle = target
        if not math.isinf(target.length):
            self._pose = piece.end

    def _into_circle(self, target: MissionTarget, length: float) -> Leg:
        return Leg(*self._pose, 1.0 / target.radius, length)

    def _add(
        self, target: MissionTarget, pieces: Sequence[Leg], climb: float, *, there: bool = False
    ) -> None:
        """Add legs, cut where the airspeed changes; `there`: after the way to the target."""
        length = sum(piece.length_m for piece in pieces)
        changes = [] if there else [(when.on(length), speed) for when, speed in target.changes]
        airspeed = target.airspeed_there if there else target.airspeed
        height, flown = self._height, 0.0
        for piece in pieces:
            rest = piece
            while rest.length_m > _MIN_M:
                while changes and changes[0][0] <= flown + _MIN_M:
                    airspeed = changes.pop(0)[1]
                part = rest
                if changes and changes[0][0] < flown + rest.length_m - _MIN_M:
                    part, rest = rest.cut(changes[0][0] - flown)
                else:
                    rest = rest._replace(length_m=0.0)
                course = math.remainder(part.course_rad, 2.0 * math.pi)
                leg = Leg(*part[:2], course, *part[3:5], height, climb, airspeed, target.item.seq)
                self._legs.append(leg)
                flown += leg.length_m
                height += climb * leg.length_m if climb else 0.0

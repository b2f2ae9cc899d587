"""How well UAVs follow a path and keep their slots, judged by their true positions.

An autopilot's word counts for two things only: that it flies the path at all, and the slot that is
in force. Where it takes itself to be is compared with the truth, so that a UAV on another path,
such as one that an operator has uploaded in flight, is not judged by this one.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ftc_autopilot.guidance.path import commands_between, locate, point_at
from gcs.results.recording import Steps
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import hypot, square

SETTLING_S = 10.0
"""A UAV's figures begin so long after it begins to follow the path; so long after its end a turn
still counts as one [s]."""

_ELSEWHERE_M = 100.0
"""Between true and supposed place along the path, or beside it where it is begun: another path."""
_NEVER = -1
_UNSETTLED, _STRAIGHT, _TURN = 0, 1, 2

ERRORS = np.dtype(
    [
        ("cross_track", "f8"),  # from the UAV's own path, positive to its right [m]
        ("height", "f8"),  # above the UAV's own path [m]
        ("slot", "f8"),  # horizontal distance from the slot [m]
        ("part", "i1"),  # of the path: a straight, a turn, or not settled yet
    ]
)
"""Errors of one UAV at one step; NaN where they are unknown."""

_FOLLOWER = np.dtype(
    [
        ("silent", "u1"),  # its autopilot does not say where it is, and begins at the start
        ("s", "f8"),  # true place along the path [m], NaN: none yet
        ("began", "i8"),  # step at which it began to follow the path
        ("turned", "i8"),  # last step in a turn
        ("flown", "i8"),  # steps at which its autopilot followed a path
        ("counted", "i8"),
        ("straight", "f8"),  # largest cross-track errors [m], NaN: none
        ("turn", "f8"),
        ("height", "f8"),
        ("height_square", "f8"),  # sum [m²]
        ("slots", "i8"),  # steps with a slot error
        ("slot", "f8"),
        ("slot_square", "f8"),
    ]
)


@dataclass(frozen=True)
class PathSummary:
    """How a UAV followed the path of its mission; errors are None where no step has one.

    Attributes:
        flown_steps: Steps at which its autopilot followed a path.
        counted_steps: Those that the errors are of: not the first 10 s, nor steps on other paths.
        straight_cross_track_m: Largest one on straight lines, later than 10 s after a turn [m].
        turn_cross_track_m: Largest one in turns and within 10 s after them [m].
        height_max_m: Largest error of the height [m].
        height_rms_m: Root mean square of it [m].
        slot_steps: Steps that the errors of the slot are of.
        slot_max_m: Largest horizontal distance from its slot, where the leader truly is [m].
        slot_rms_m: Root mean square of it [m].
    """

    flown_steps: int
    counted_steps: int
    straight_cross_track_m: float | None
    turn_cross_track_m: float | None
    height_max_m: float | None
    height_rms_m: float | None
    slot_steps: int
    slot_max_m: float | None
    slot_rms_m: float | None


@dataclass(frozen=True)
class PassedCommand:
    """A command of the mission that a UAV passed, and where it was then.

    Attributes:
        item: Number of the item.
        command: Its name.
        time_s: [s].
        north_m: [m].
        east_m: [m].
        height_m: Above the origin [m].
    """

    item: int
    command: str
    time_s: float
    north_m: float
    east_m: float
    height_m: float


class PathErrors:
    """Errors against the path, step by step."""

    def __init__(
        self,
        paths: np.ndarray,
        leaders: tuple[int, ...],
        step_us: int,
        silent: Collection[int] = (),
    ) -> None:
        """Prepare for the first step.

        Args:
            paths: Of each UAV without its slot, shape (n,), dtype `PATH`; members of a formation
                have the same.
            leaders: Indices of the UAVs whose place the slots count from, the first that follows
                the path at a step; empty: there are no slots.
            step_us: Time from each step to the next [µs].
            silent: Indices of the UAVs whose autopilots do not say where on the path they are.
        """
        self._paths, self._leaders = paths, np.array(leaders, np.int64)
        self._settling = round(SETTLING_S * 1e6 / step_us)
        self.followers = np.zeros(len(paths), _FOLLOWER)
        for name in ("s", "straight", "turn", "height", "slot"):
            self.followers[name] = np.nan
        self.followers["began"] = self.followers["turned"] = _NEVER
        self.followers["silent"][list(silent)] = 1

    def of(self, steps: Steps) -> np.ndarray:
        """Return the errors of the next steps, shape (steps, n), dtype `ERRORS`."""
        errors = np.zeros(steps.signals.shape, ERRORS)
        path_errors(
            first=steps.first,
            settling=self._settling,
            states=steps.states,
            signals=steps.signals,
            paths=self._paths,
            leaders=self._leaders,
            followers=self.followers,
            errors=errors,
        )
        return errors


class PathFigures:
    """The figures of all UAVs that follow a path, taken while a flight is flown."""

    def __init__(
        self,
        paths: np.ndarray,
        leaders: tuple[int, ...],
        step_us: int,
        silent: Collection[int] = (),
    ) -> None:
        """Prepare as for `PathErrors`."""
        self._errors = PathErrors(paths, leaders, step_us, silent)
        self._paths, self._step_us = paths, step_us
        self._reached = np.full(len(paths), -1.0)  # greatest place along the path so far [m]
        self._passed: list[list[tuple[int, int, np.ndarray]]] = [[] for _ in paths]

    def add(self, steps: Steps) -> None:
        """Take the next steps."""
        errors = self._errors.of(steps)
        gather(errors, self._errors.followers)
        for i in np.flatnonzero(
            (self._paths["commands"] > 0) & (self._errors.followers["silent"] == 0)
        ):
            self._note_commands(int(i), steps, np.isfinite(errors["cross_track"][:, i]))

    def _note_commands(self, i: int, steps: Steps, known: np.ndarray) -> None:
        """Note step and place of each command that the i-th UAV passes."""
        rows = np.flatnonzero(known)
        if not len(rows):
            return
        reached = np.maximum.accumulate(steps.signals["path_position"][rows, i])
        before, self._reached[i] = self._reached[i], max(self._reached[i], reached[-1])
        for at, item in commands_between(self._paths[i], before, self._reached[i]):
            k = int(rows[np.searchsorted(reached, at)])
            self._passed[i].append((item, steps.first + k, steps.states[k, i, :3].copy()))

    def commands(self, i: int, names: Mapping[int, str]) -> tuple[PassedCommand, ...]:
        """Return the commands that the i-th UAV has passed, given the names of items."""
        passed = []
        for item, step, place in self._passed[i]:
            north, east, down = place.tolist()
            time_s = step * self._step_us / 1e6
            passed.append(PassedCommand(item, names[item], time_s, north, east, -down))
        return tuple(passed)

    def summary(self, i: int) -> PathSummary:
        """Return the figures of the i-th UAV."""
        own = self._errors.followers[i]
        return PathSummary(
            flown_steps=int(own["flown"]),
            counted_steps=int(own["counted"]),
            straight_cross_track_m=_known(own["straight"]),
            turn_cross_track_m=_known(own["turn"]),
            height_max_m=_known(own["height"]),
            height_rms_m=_rms(own["height_square"], own["counted"]),
            slot_steps=int(own["slots"]),
            slot_max_m=_known(own["slot"]),
            slot_rms_m=_rms(own["slot_square"], own["slots"]),
        )


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _rms(total: float, count: int) -> float | None:
    return math.sqrt(total / count) if count else None


@compiled
def path_errors(
    first: int,
    settling: int,
    states: np.ndarray,
    signals: np.ndarray,
    paths: np.ndarray,
    leaders: np.ndarray,
    followers: np.ndarray,
    errors: np.ndarray,
) -> None:
    """Compute the errors of consecutive steps.

    Args:
        first: Number of the first step.
        settling: `SETTLING_S` in steps.
        states: True ones, shape (steps, n, 12).
        signals: Shape (steps, n), dtype `SIGNALS`: `V` is NaN where an autopilot received no
            state, `path_position` where no path is followed.
        paths: Shape (n,), dtype `PATH`.
        leaders: Indices of the UAVs that slots count from.
        followers: Shape (n,), updated.
        errors: Shape (steps, n), dtype `ERRORS`, written.
    """
    n = len(paths)
    known = np.zeros(n, np.bool_)
    for k in range(len(states)):
        for i in range(n):
            error = errors[k, i]
            error["cross_track"] = error["height"] = error["slot"] = np.nan
            error["part"] = _UNSETTLED
            known[i] = _follow(
                first + k, settling, states[k, i], signals[k, i], paths[i], followers[i], error
            )
        leader = _leader(leaders, known)
        for i in range(n):
            if leader >= 0 and known[i]:
                xi = followers[leader]["s"] - signals[k, leader]["slot"][0]
                slot = signals[k, i]["slot"]
                errors[k, i]["slot"] = _from_slot(paths[i], xi, slot, states[k, i])


@compiled
def _follow(
    step: int,
    settling: int,
    state: np.ndarray,
    signal: np.void,
    path: np.void,
    own: np.void,
    error: np.void,
) -> bool:
    """Compute a UAV's errors but the slot's at one step, and return whether it has a place."""
    supposed, beside, above = signal["path_position"], signal["slot"][1], signal["slot"][2]
    if own["silent"] == 1:
        supposed, beside, above = 0.0 if math.isnan(own["s"]) else own["s"], 0.0, 0.0
    follows = not math.isnan(supposed)
    own["flown"] += follows
    if not follows and not math.isnan(signal["V"]):
        _forget(own)
    if math.isnan(own["s"]):
        own["s"] = supposed
    north, east, down = state[0], state[1], state[2]
    if path["count"] == 0 or not math.isfinite(own["s"] + north + east):
        return False
    s, right = locate(path, north, east, own["s"])
    off = right - beside if own["began"] == _NEVER else 0.0
    if follows and not (abs(s - supposed) < _ELSEWHERE_M and abs(off) < _ELSEWHERE_M):
        _forget(own)
        return False
    own["s"] = s
    point = point_at(path, s)
    if own["began"] == _NEVER or 0.0 < path["take_off"] > s:  # a take-off climbs as it can
        own["began"] = step
    if point.curvature != 0.0:
        own["turned"] = step
    if follows:
        error["cross_track"] = right - beside
        error["height"] = -down - point.height - above
        error["part"] = _part(step, settling, own)
    return follows


@compiled
def _forget(own: np.void) -> None:
    """Note that a UAV follows no path."""
    own["s"], own["began"], own["turned"] = np.nan, _NEVER, _NEVER


@compiled
def _part(step: int, settling: int, own: np.void) -> int:
    """Return the part of the path that a UAV is on."""
    if step - own["began"] <= settling:
        return _UNSETTLED
    if own["turned"] != _NEVER and step - own["turned"] <= settling:
        return _TURN
    return _STRAIGHT


@compiled
def _leader(leaders: np.ndarray, known: np.ndarray) -> int:
    """Return the first of the leaders whose place is known, or -1."""
    for leader in leaders:
        if known[leader]:
            return int(leader)
    return -1


@compiled
def _from_slot(path: np.void, xi: float, slot: np.ndarray, state: np.ndarray) -> float:
    """Return the horizontal distance from a slot of the formation at xi on the path [m]."""
    point = point_at(path, xi + slot[0])
    north = point.north - math.sin(point.course) * slot[1]
    east = point.east + math.cos(point.course) * slot[1]
    return hypot(state[0] - north, state[1] - east)


@compiled
def gather(errors: np.ndarray, followers: np.ndarray) -> None:
    """Take errors, shape (steps, n), dtype `ERRORS`, into the figures of the UAVs."""
    for k in range(len(errors)):
        for i in range(len(followers)):
            error, own = errors[k, i], followers[i]
            if error["part"] == _UNSETTLED:
                continue
            own["counted"] += 1
            if error["part"] == _STRAIGHT:
                own["straight"] = _larger(own["straight"], error["cross_track"])
            else:
                own["turn"] = _larger(own["turn"], error["cross_track"])
            own["height"] = _larger(own["height"], error["height"])
            own["height_square"] += square(error["height"])
            if not math.isnan(error["slot"]):
                own["slots"] += 1
                own["slot"] = _larger(own["slot"], error["slot"])
                own["slot_square"] += square(error["slot"])


@compiled
def _larger(largest: float, error: float) -> float:
    """Return the larger absolute value; the error's if there is no largest yet."""
    return abs(error) if math.isnan(largest) else max(largest, abs(error))

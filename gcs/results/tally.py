"""The counts and sums behind the figures of a flight, taken while it is flown.

They cover every step at full rate, whatever is recorded. Sums are taken in the order of the
steps, so that they do not depend on how the steps arrive.
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.diagnosis import LOST
from gcs.results.beside import Beside, beside_of
from gcs.results.mission_paths import leaders_of, paths_of, silent_in
from gcs.results.path_following import PathFigures
from gcs.results.recording import Steps
from gcs.results.separation import Separation
from gcs.results.synchronisation import Synchronisation
from gcs.results.traffic import Traffic
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import dot, vec3

FINAL_S = 1.0
"""The final error is the largest one of this long before the end [s]."""
_SETTLING_S = 1.0  # the largest error counts after this time
_MAX_ANGLE = math.pi / 2.0  # error of an angle beyond which attitude or heading is lost [rad]
_NEVER = -1

TALLY = np.dtype(
    [
        ("active", "i8"),  # steps at which the law was evaluated
        ("missing", "i8"),  # steps at which the autopilot received no state
        ("messages", "i8"),  # steps with at least one event
        ("neighbour_messages", "i8"),  # steps with a message to the neighbours
        ("neighbour_periods", "i8"),  # steps after the first that are not missing
        ("events", "i8", (N_CHANNELS,)),
        ("last_event", "i8", (N_CHANNELS,)),  # step, -1: none yet
        ("min_gap", "i8", (N_CHANNELS,)),  # steps between two events, 0: none yet
        ("heard", "i8"),  # 1: `target` is known
        ("target", "f8", (2, 4)),  # command and reference of the last step that is not missing
        ("counted", "i8", (2,)),  # steps with an error against command and reference
        ("sum", "f8", (2, 4)),  # of absolute errors [m/s, rad]
        ("settled", "i8"),  # steps after the first second with an error against the reference
        ("largest", "f8", (4,)),  # of these errors, absolute
        ("attitude_lost", "i8"),  # first step with roll or pitch more than 90° off, -1: none
        ("heading_lost", "i8"),
        ("lost", "i8"),  # bit per channel: its diagnosis has it as lost
        ("changes", "i8"),  # steps at which that changed
        ("control_failed", "i8"),  # first step with a demand that was not finite, -1: none
        ("not_finite", "i8", (N_CHANNELS,)),  # steps with one
        ("highest_down", "f8"),  # largest distance below the ground [m]
    ]
)
"""What is counted of one UAV."""


class Decision(NamedTuple):
    """An actuator declared lost, or back in service, by a UAV's diagnosis."""

    step: int
    channel: int
    lost: bool
    offset: float  # the actuator's position [rad or N]


class Tally:
    """The counts of one flight.

    Attributes:
        uavs: Shape (n,), dtype `TALLY`.
        decisions: Of each UAV's diagnosis, by channel and then by time.
        steps: Steps counted.
        traffic: Bytes on the links.
        synchronisation: Sums of the synchronisation errors.
        separation: Least distance between two UAVs.
        following: How the UAVs follow their path; None for a scenario without a mission.
        beside: Triggers beside foreign autopilots, by index of the UAV.
        motion: Of UAVs of foreign autopilots, by index, shape (2, 4): least and greatest roll,
            pitch [deg], altitude [m] and airspeed [m/s].
    """

    def __init__(self, scenario: Scenario) -> None:
        n, step_us = len(scenario.uavs), scenario.step_us
        self._step_us, self._normal = step_us, scenario.ground.normal
        self._foreign = [i for i, uav in enumerate(scenario.uavs) if uav.id in scenario.foreign]
        found = ((i, beside_of(scenario, uav.id)) for i, uav in enumerate(scenario.uavs))
        self.beside: dict[int, Beside] = {i: one for i, one in found if one is not None}
        self.motion = {i: np.array([[np.inf] * 4, [-np.inf] * 4]) for i in self._foreign}
        self.steps = 0
        self.traffic = Traffic(scenario)
        self.synchronisation = Synchronisation(scenario)
        self.separation = Separation(tuple(uav.id for uav in scenario.uavs), step_us)
        paths = paths_of(scenario)
        self.following = (
            None
            if paths is None
            else PathFigures(paths, leaders_of(scenario), step_us, silent_in(scenario))
        )
        self.uavs = np.zeros(n, TALLY)
        for name in ("last_event", "attitude_lost", "heading_lost", "control_failed"):
            self.uavs[name] = _NEVER
        self.uavs["highest_down"] = -np.inf
        self.uavs["target"] = np.nan
        # errors against the reference, over the window of the final error: row step % length
        self._tail = np.full((n, math.ceil(FINAL_S * 1e6 / step_us) + 1, 4), np.nan)
        self._unheard: list[list[Steps]] = [[] for _ in range(n)]
        self._decisions: list[list[Decision]] = [[] for _ in range(n)]

    def add(self, steps: Steps) -> None:
        """Count the next steps.

        Before an autopilot's first state, its first command and reference hold: its steps wait
        for these. They are few, because the plant gives up a silent autopilot.
        """
        errors = np.full((steps.length, len(self.uavs), 4), np.nan)
        for i, tally in enumerate(self.uavs):
            if not tally["heard"]:
                known = np.flatnonzero(~np.isnan(steps.signals["V"][:, i]))
                if not len(known):
                    own = (array[:, i : i + 1].copy() for array in steps[1:])
                    self._unheard[i].append(Steps(steps.first, *own))
                    continue
                tally["target"][0] = steps.signals["command"][known[0], i]
                tally["target"][1] = steps.signals["reference"][known[0], i]
                self._count_unheard(i)
            self._count(i, steps, i, errors)
        self.synchronisation.add(errors)
        self.traffic.add(steps)
        self.separation.add(steps.first, steps.states)
        if self.following is not None:
            self.following.add(steps)
        self.steps += steps.length

    def finish(self) -> None:
        """Count the steps of autopilots that never received a state: these have no errors."""
        for i in range(len(self.uavs)):
            self._count_unheard(i)

    def decisions(self, i: int) -> list[Decision]:
        """Return the decisions of the i-th UAV's diagnosis, by time."""
        return sorted(self._decisions[i], key=lambda decision: decision[:2])

    def largest_final_error(self, i: int, from_s: float) -> np.ndarray:
        """Return the i-th UAV's largest errors against the reference at the end [m/s, rad].

        Args:
            i: Index of the UAV.
            from_s: Time at which they begin to count, at most `FINAL_S` before the end [s].

        Returns:
            Shape (4,), absolute; NaN if no step has an error.
        """
        tail = self._tail[i]
        steps = np.arange(max(self.steps - len(tail), 0), self.steps)
        errors = tail[steps[steps * self._step_us / 1e6 >= from_s] % len(tail)]
        known = np.abs(errors[np.isfinite(errors).all(axis=1)])
        return np.asarray(known.max(axis=0)) if len(known) else np.full(4, np.nan)

    def _count_unheard(self, i: int) -> None:
        for early in self._unheard[i]:
            self._count(i, early, 0, np.empty((early.length, 1, 4)))
        self._unheard[i].clear()

    def _count(self, i: int, steps: Steps, column: int, errors: np.ndarray) -> None:
        """Count the i-th UAV's steps, which are a column of the arrays."""
        before = self.uavs[i].copy()
        count_steps(
            first=steps.first,
            step_us=self._step_us,
            states=np.ascontiguousarray(steps.states),
            wind=np.ascontiguousarray(steps.wind),
            signals=np.ascontiguousarray(steps.signals),
            normal=self._normal,
            i=column,
            tally=self.uavs[i],
            tail=self._tail[i],
            errors=errors,
        )
        if i in self._foreign:
            _count_foreign(steps, column, self.uavs[i], self.motion[i])
        if (beside := self.beside.get(i)) is not None:
            beside.add(steps, column)
        if self.uavs[i]["changes"] > before["changes"]:
            self._note_decisions(i, steps.first, steps.signals[:, column], int(before["lost"]))

    def _note_decisions(self, i: int, first: int, signals: np.ndarray, mask: int) -> None:
        """Note what a UAV's diagnosis has decided, given the channels lost before."""
        flown = np.flatnonzero(np.isfinite(signals["command"][:, 0]))
        signals = signals[flown]
        lost = signals["phase"] == LOST
        before = (mask >> np.arange(N_CHANNELS) & 1).astype(np.bool_)
        for k, c in np.argwhere(np.diff(lost, axis=0, prepend=before[None])):
            offset = float(signals["offset"][k, c])
            decision = Decision(first + int(flown[k]), int(c), bool(lost[k, c]), offset)
            self._decisions[i].append(decision)


def _count_foreign(steps: Steps, column: int, tally: np.void, motion: np.ndarray) -> None:
    """Count what a foreign autopilot did, whose references are not known.

    It controls in every step; its attitude is lost when it is more than 90° from the horizon.
    """
    airspeed = steps.signals["V"][:, column]
    tally["active"] += np.isfinite(airspeed).sum()
    roll, pitch = np.moveaxis(steps.states[:, column, 6:8], 1, 0)
    within = np.rad2deg((roll + np.pi) % (2.0 * np.pi) - np.pi)
    values = np.stack((within, np.rad2deg(pitch), -steps.states[:, column, 2], airspeed))
    motion[0] = np.fmin.reduce(np.column_stack((motion[0], values)), axis=1)
    motion[1] = np.fmax.reduce(np.column_stack((motion[1], values)), axis=1)
    tilted = np.flatnonzero((np.cos(roll) < 0.0) | (np.abs(pitch) > _MAX_ANGLE))
    if tally["attitude_lost"] < 0 and len(tilted):
        tally["attitude_lost"] = steps.first + tilted[0]


@compiled
def count_steps(
    first: int,
    step_us: int,
    states: np.ndarray,
    wind: np.ndarray,
    signals: np.ndarray,
    normal: np.ndarray,
    i: int,
    tally: np.void,
    tail: np.ndarray,
    errors: np.ndarray,
) -> None:
    """Count consecutive steps of one UAV.

    Args:
        first: Number of the first step.
        step_us: Control period [µs].
        states: Shape (steps, n, 12).
        wind: Shape (steps, n, 3).
        signals: Shape (steps, n), dtype `SIGNALS`.
        normal: Into the ground, NED, shape (3,).
        i: Index of the UAV in these.
        tally: Record of dtype `TALLY`, updated in place.
        tail: Errors against the reference, row step % length, updated in place.
        errors: Shape (steps, n, 4), against the reference [m/s, rad], written.
    """
    target = tally["target"]
    for k in range(len(states)):
        step = first + k
        _count_signals(step, signals[k, i], tally)
        below = dot(vec3(normal), vec3(states[k, i, 0:3]))
        tally["highest_down"] = max(tally["highest_down"], below)
        error, known = (0.0, 0.0, 0.0, 0.0), False
        for against in range(2):  # the command, and then the reference
            error = _error(states[k, i], wind[k, i], target[against])
            known = math.isfinite(error[0]) and math.isfinite(error[1])
            known = known and math.isfinite(error[2]) and math.isfinite(error[3])
            if known:
                tally["counted"][against] += 1
                for j in range(4):
                    tally["sum"][against, j] += abs(error[j])
        if known and step * step_us / 1e6 > _SETTLING_S:
            tally["settled"] += 1
            for j in range(4):
                tally["largest"][j] = max(tally["largest"][j], abs(error[j]))
        tilted = abs(error[1]) > _MAX_ANGLE or abs(error[2]) > _MAX_ANGLE
        if tally["attitude_lost"] < 0 and tilted:
            tally["attitude_lost"] = step
        if tally["heading_lost"] < 0 and abs(error[3]) > _MAX_ANGLE:
            tally["heading_lost"] = step
        for j in range(4):
            tail[step % len(tail), j] = errors[k, i, j] = error[j]


@compiled
def _error(
    state: np.ndarray, wind: np.ndarray, target: np.ndarray
) -> tuple[float, float, float, float]:
    """Return the errors of airspeed [m/s], roll, pitch and yaw [rad]."""
    u, v, w = state[3] - wind[0], state[4] - wind[1], state[5] - wind[2]
    return (
        math.sqrt(u * u + v * v + w * w) - target[0],
        wrap(state[6] - target[1]),
        state[7] - target[2],
        wrap(state[8] - target[3]),
    )


@compiled
def _count_signals(step: int, signal: np.void, tally: np.void) -> None:
    """Count what an autopilot did at one step; a record of dtype `SIGNALS`."""
    lost = 0
    for c in range(N_CHANNELS):
        lost |= (signal["phase"][c] == LOST) << c
    flown = math.isfinite(signal["command"][0])  # else it says nothing of the diagnosis
    if flown and lost != tally["lost"]:
        tally["lost"] = lost
        tally["changes"] += 1
    if math.isnan(signal["V"]):
        tally["missing"] += 1
    elif step > 0:
        tally["neighbour_periods"] += 1
        tally["neighbour_messages"] += signal["neighbour_message"]
    if not math.isnan(signal["V"]):
        tally["heard"] = 1
        for j in range(4):
            tally["target"][0, j] = signal["command"][j]
            tally["target"][1, j] = signal["reference"][j]
    tally["active"] += flown
    _count_events(step, signal["events"], tally)
    if signal["not_finite"] != 0:
        if tally["control_failed"] < 0:
            tally["control_failed"] = step
        for c in range(N_CHANNELS):
            tally["not_finite"][c] += (signal["not_finite"] >> c) & 1


@compiled
def _count_events(step: int, mask: int, tally: np.void) -> None:
    if mask == 0:
        return
    tally["messages"] += 1
    for c in range(N_CHANNELS):
        if mask & (1 << c):
            gap = step - tally["last_event"][c]
            if tally["events"][c] > 0 and (tally["min_gap"][c] == 0 or gap < tally["min_gap"][c]):
                tally["min_gap"][c] = gap
            tally["events"][c] += 1
            tally["last_event"][c] = step

"""What a vehicle does by itself when the diagnosis declares an actuator lost: COM_ACT_FAIL_ACT.

It is looked at between two control steps, at fixed simulated times, so that a flight in lockstep is
the same each time. Each loss acts once: whoever changes the mode afterwards is respected. A surface
must have been lost for a second: in gusts a healthy one may be, but is back after its trial. Who is
on the ground or in the approach lands.
"""

from collections.abc import Iterator

import numpy as np

from ftc_autopilot.common.phases import LOST
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.guidance.failsafe_parameters import REPORT, TO_LAND, TO_LOITER, TO_RTL
from ftc_autopilot.guidance.runway_state import FINAL, FLARE, is_glide, on_ground
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.modes import Modes
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, LOITER, N_CHANNELS, RTL, THROTTLE
from mavlink_defs.runtime.jit import in_python

_PERIOD_US = 100_000
"""Simulated time between two looks [µs]: as of the fence."""
_SURE_US = 1_000_000
"""Simulated time for which a surface is lost before that acts [µs]: more than a trial lasts."""
_NEVER = 2**62
_ANOTHER_M = 3.0
"""Error of the height from which another glide is planned, before the final [m]."""
_flies_glide, _stands = in_python(is_glide), in_python(on_ground)
_NAMES = {TO_LOITER: "LOITER", TO_LAND: "landing", TO_RTL: "RTL"}


class ActuatorFailsafe:
    """Acts on actuators that are lost."""

    def __init__(self, hot: HotState, controllers: Controllers, modes: Modes) -> None:
        """Note nothing yet.

        Args:
            hot: What the compiled loop knows.
            controllers: Of one UAV.
            modes: Its modes.
        """
        self._uav, self._hot = controllers.uavs[0], hot
        self._modes, self._path = modes, modes.path
        self._period = max(_PERIOD_US // hot.step_us, 1)
        self._since = [_NEVER] * N_CHANNELS  # the first look at which each was lost
        self._changes: list[Change] = []
        self.restart()

    def restart(self, acted: int = 0) -> None:
        """Begin another flight, or go on with one.

        Args:
            acted: As of `acted` then.
        """
        self._lost = {c for c in range(N_CHANNELS) if acted >> c & 1}
        self._next_step = self._hot.step + self._period

    @property
    def acted(self) -> int:
        """Bit per actuator whose loss has acted."""
        return sum(1 << c for c in self._lost)

    @property
    def next_step(self) -> int:
        """Step after which the next look is due; far away if none is."""
        return self._next_step if self._action != REPORT else _NEVER

    def handle_timer(self) -> None:
        """Look at the actuators if that is due, and act on a loss."""
        if self._hot.step < self._next_step or not self._modes.running:
            return
        self._next_step = self._hot.step - self._hot.step % self._period + self._period
        before, self._lost = self._lost, self._sure_losses()
        phase = self._path.phase
        if self._action == REPORT or not self._modes.armed or _stands(phase):
            return
        if THROTTLE in self._lost and self._path.flown and _flies_glide(self._path.record):
            self._glide_on(phase)
        elif names := [ACTUATORS[c] for c in sorted(self._lost - before)]:
            text = f"{' and '.join(names)} lost: {self._act(phase)}"
            self._changes.append(Change("failsafe", dialect.MAV_SEVERITY_WARNING, text))

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call."""
        yield from self._changes
        self._changes.clear()

    # inside

    @property
    def _action(self) -> int:
        return int(self._uav["parameters"]["failsafe"]["act_fail_act"])

    def _sure_losses(self) -> set[int]:
        """Return what has been lost for long enough to act, or has acted."""
        lost = self._uav["signals"]["phase"] == LOST
        step, sure = self._hot.step, _SURE_US // self._hot.step_us
        self._since = [
            min(since, step) if is_lost else _NEVER
            for since, is_lost in zip(self._since, lost, strict=True)
        ]
        return {
            c
            for c in np.flatnonzero(lost).tolist()
            if c == THROTTLE or c in self._lost or step - self._since[c] >= sure
        }

    def _act(self, phase: int) -> str:
        """Do what a loss does; return that as the end of a text."""
        if self._without_thrust and self._action != TO_LOITER:
            return self._begin_glide()
        if phase in (FINAL, FLARE):
            return "the approach goes on"
        action = self._action
        if action == TO_LAND and self._modes.land() != dialect.MAV_RESULT_ACCEPTED:
            action = TO_RTL
        if action != TO_LAND and not self._modes.enter(LOITER if action == TO_LOITER else RTL):
            return f"{_NAMES[action]} cannot be flown"
        return _NAMES[action]

    @property
    def _without_thrust(self) -> bool:
        """Whether the thrust that is left does not hold the height."""
        runway = self._path.planner.limits.runway
        if THROTTLE not in self._lost or runway is None:
            return False
        weight = float(self._uav["aircraft"]["m"] * self._uav["aircraft"]["g"])
        return float(self._uav["signals"]["offset"][THROTTLE]) < runway.idle * weight

    def _begin_glide(self) -> str:
        way, there = self._path.glide()
        self._modes.guide(way, RTL)
        return "glide to the runway" if there else "no runway within reach, straight ahead"

    def _glide_on(self, phase: int) -> None:
        """Plan again what wind or fault have moved from its height, up to the final."""
        path = self._path
        error = path.here()[2] - float(path.point().height)
        if phase in (FINAL, FLARE) or abs(error) < _ANOTHER_M:
            return
        way, there = path.glide()
        if there:
            path.begin(way)

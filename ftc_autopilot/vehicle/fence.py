"""The fence of one vehicle: breaches are found, reported and acted upon.

The check belongs to no control step: it is made between two of them, at fixed simulated times, so
that a flight in lockstep is the same each time. As in ArduPlane a breach acts once: whoever changes
the mode afterwards is respected until the aircraft has been inside, and what the fence itself has
begun to fly goes on through further breaches.
"""

import math
import struct
from collections.abc import Iterator, Sequence

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.fence import Fence, FenceWatch, decode_fence
from ftc_autopilot.guidance.fence_parameters import (
    ALT_MAX,
    ALT_MIN,
    REPORT,
    TO_GUIDED,
    TO_LAND,
    TO_LOITER,
)
from ftc_autopilot.guidance.runway_state import FLYING
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.flight_path import Way
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.modes import Modes, Say
from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.constants import AUTOLAND, GUIDED, LOITER, MAX_MISSION_ITEMS, MODE_NAMES, RTL
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.profile import ItemError
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_server import MissionAccepted, MissionRefused, MissionServer

_PERIOD_US = 100_000
"""Simulated time between two checks [µs]: as position is reported."""
_NEVER = 2**62
_LOW, _HIGH, _BOUNDARY = (
    dialect.FENCE_BREACH_MINALT,
    dialect.FENCE_BREACH_MAXALT,
    dialect.FENCE_BREACH_BOUNDARY,
)
_STATE = struct.Struct("<4B2I")
"""Breaches as bits, last type, floor off, flies own, count, time [ms]."""


class VehicleFence:
    """Holds the fence, and watches it while it is enabled and the vehicle flies.

    Attributes:
        server: Serves its items.
        fence: The areas.
    """

    def __init__(
        self,
        own: SystemId,
        origin: Origin,
        record: np.ndarray,
        modes: Modes,
        hot: HotState,
        clock: VehicleClock,
        say: Say,
    ) -> None:
        """Hold no fence.

        Args:
            own: SystemId of the vehicle.
            origin: Of the simulation's world.
            record: Its parameters, `FenceRecords.fence`.
            modes: Modes of the vehicle.
            hot: What its compiled loop knows.
            clock: Its time since boot.
            say: Announces a text.
        """
        self.fence = Fence()
        self._origin, self._record = origin, record
        self._modes, self._path, self._hot = modes, modes.path, hot
        self._clock, self._say = clock, say

        def validate(items: Sequence[MissionItem]) -> None:
            self._decoded(items)

        self.server = MissionServer(
            own, validate, MAX_MISSION_ITEMS, mission_type=dialect.MAV_MISSION_TYPE_FENCE
        )
        self._period = max(_PERIOD_US // hot.step_us, 1)
        self._changes: list[Change] = []
        self._without_floor = False
        self.restart()

    def restart(self) -> None:
        """Forget the breaches, for another flight; fence and parameters stay."""
        self._breaches: set[int] = set()
        self._count, self._type, self._time_ms = 0, dialect.FENCE_BREACH_NONE, 0
        self._next_step = self._period
        self._own_path = -1  # number of the path that it has begun

    # state

    @property
    def enabled(self) -> bool:
        """Whether it is watched."""
        return bool(self._number("enable"))

    @property
    def is_breached(self) -> bool:
        """Whether the aircraft is outside, by the last check."""
        return bool(self._breaches)

    @property
    def next_step(self) -> int:
        """Step after which the next check is due; far away if none is."""
        return self._next_step if self.enabled else _NEVER

    @property
    def watch(self) -> FenceWatch:
        """What is watched, if it is enabled."""
        home, floor = self._path.home.at, not self._without_floor
        return FenceWatch(self.fence, self._record[0], home, floor)

    def held_height(self, height: float) -> float:
        """Return the height nearest to one that is within the heights watched, by the margin [m].

        Args:
            height: Above the origin [m].
        """
        if not self.enabled:
            return height
        home, kinds = self._path.home.at.height_m, self.watch.kinds
        if kinds & ALT_MIN:
            height = max(height, home + self._number("alt_min_m") + self._number("margin_m"))
        if kinds & ALT_MAX:
            height = min(height, home + self._number("alt_max_m") - self._number("margin_m"))
        return height

    def objection(self) -> str | None:
        """Return why the vehicle must not be armed; None if it may."""
        if not self.enabled:
            return None
        if self.watch.is_empty:
            return "FENCE_ENABLE is 1, and there is no fence: upload one, or set it to 0"
        start = self._path.planner.start_of(self._hot.measured, self._path.airspeed)
        return self.watch.objection(self._path.here(), stands=start.stands)

    @message(
        dialect.MAVLink_fence_status_message,
        every_s=1.0,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def status(self) -> MAVLink_message:
        """Return FENCE_STATUS."""
        return dialect.MAVLink_fence_status_message(
            int(self.is_breached),
            min(self._count, 0xFFFF),
            self._type,
            self._time_ms,
            dialect.FENCE_MITIGATE_NONE,
        )

    # what happens to it

    def handle_events(self) -> bool:
        """Put in force what was uploaded; return whether the fence has changed."""
        changes = False
        for event in self.server.events():
            match event:
                case MissionAccepted(items):
                    before, self.fence = self.fence, self._decoded(items)
                    changes = True
                    if items or before.areas:
                        self._announce()
                case MissionRefused(_, text) if text:
                    self._say(dialect.MAV_SEVERITY_WARNING, text)
        return changes

    def enable(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_DO_FENCE_ENABLE, as a command or as an item of a mission.

        Param 1: 0 disables it, 1 enables it, 2 disables the least height alone until it is enabled
        again; 2 (types) must be 0 or no value: they are FENCE_TYPE.
        """
        what, types = params[0], params[1]
        if what not in {0.0, 1.0, 2.0}:
            return self._refuse(f"param 1 is {what:g}, must be 0 (off), 1 (on) or 2 (no floor)")
        if types != 0.0 and not math.isnan(types):
            return self._refuse(f"param 2 is {types:g}, must be 0; FENCE_TYPE says what is watched")
        if what == 1.0 and self.watch.is_empty:
            self._refuse("there is no fence")
            return dialect.MAV_RESULT_FAILED
        self._without_floor = what == 2.0
        if what != 2.0:
            self._record["enable"] = int(what)
        text = ("fence disabled", "fence enabled", "fence without least height")[int(what)]
        self._say(dialect.MAV_SEVERITY_INFO, text)
        return dialect.MAV_RESULT_ACCEPTED

    def handle_timer(self) -> None:
        """Check the fence if that is due, and act on a breach."""
        if not self.enabled:
            self._breaches.clear()
            return
        if self._hot.step < self._next_step or not self._modes.running:
            return
        self._next_step = self._hot.step - self._hot.step % self._period + self._period
        if not self._modes.armed or self._modes.is_unplaced:
            return
        why = {kind: why for kind, clear, why in self._new_breaches()}
        if why:
            self._count += 1
            self._type, self._time_ms = max(why), self._clock.boot_us // 1000 % 2**32
            action = self._act()
            text = f"fence breached: {'; '.join(why.values())}{action}"
            self._changes.append(Change("fence", dialect.MAV_SEVERITY_WARNING, text))

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call."""
        yield from self._changes
        self._changes.clear()

    # checkpoints

    def state(self) -> bytes:
        """Return parameters and breaches, for a checkpoint."""
        breaches = sum(1 << kind for kind in self._breaches)
        flags = self._without_floor, self._own_path == self._path.number
        own = _STATE.pack(breaches, self._type, *flags, self._count, self._time_ms)
        return self._record.tobytes() + own

    def resume(self, items: Sequence[MissionItem], state: bytes) -> None:
        """Restore what a checkpoint has: items, and the bytes of `state`."""
        self.server.restore(tuple(items), 0)
        self.fence = decode_fence(items, self._origin)
        if len(state) == self._record.nbytes + _STATE.size:
            self._record[:] = np.frombuffer(state[: -_STATE.size], self._record.dtype)
            bits, self._type, floor, flies_own, self._count, self._time_ms = _STATE.unpack(
                state[-_STATE.size :]
            )
            self._without_floor = bool(floor)
            self._own_path = self._path.number if flies_own else -1
            self._breaches = {kind for kind in (_LOW, _HIGH, _BOUNDARY) if bits >> kind & 1}

    # inside

    def _number(self, name: str) -> float:
        return float(self._record[name][0])

    def _decoded(self, items: Sequence[MissionItem]) -> Fence:
        return decode_fence(items, self._origin, self._path.home.at)

    def _new_breaches(self) -> Iterator[tuple[int, float, str]]:
        """Yield the breaches that begin, as of `FenceWatch.at`; end those that are over."""
        least: dict[int, tuple[float, str]] = {}
        watch = self.watch
        if self._path.phase != FLYING or self._modes.mode == AUTOLAND:  # takes off or lands
            watch = watch._replace(floor=False)
        for kind, clear, why in watch.at(self._path.here()):
            least[kind] = min(least.get(kind, (math.inf, "")), (clear, why))
        was_breached, margin = self.is_breached, self._number("margin_m")
        for kind in (_LOW, _HIGH, _BOUNDARY):
            clear, why = least.get(kind, (math.inf, ""))
            if clear < 0.0 and kind not in self._breaches:
                self._breaches.add(kind)
                yield kind, clear, why
            elif clear >= margin:
                self._breaches.discard(kind)
        if was_breached and not self._breaches:
            self._changes.append(Change("fence", dialect.MAV_SEVERITY_NOTICE, "inside the fence"))

    def _act(self) -> str:
        """Do what a breach does; return that as the end of a text."""
        action = int(self._number("action"))
        if action == REPORT:
            return ""
        if self._own_path == self._path.number:
            return f"; goes on in {MODE_NAMES[self._modes.mode]}"
        if action == TO_LAND and self._modes.land() == dialect.MAV_RESULT_ACCEPTED:
            self._own_path = self._path.number
            return "; landing"
        mode = {TO_LOITER: LOITER, TO_GUIDED: GUIDED}.get(action, RTL)
        try:
            self._modes.guide(self._way(mode), mode)
        except ItemError as error:
            return f"; {MODE_NAMES[mode]} cannot be flown: {error.reason}"
        self._own_path = self._path.number
        return f"; {MODE_NAMES[mode]}"

    def _way(self, mode: int) -> Way:
        """Return what a mode flies after a breach."""
        path, home = self._path, self._path.home.at
        height = self.held_height(path.here()[2])
        if mode == LOITER:
            return path.circle_here(height)
        if mode == RTL or self._number("ret_rally"):
            return path.way_home()
        if (above := self._number("ret_alt_m")) > 0.0:
            height = home.height_m + above
        return path.way_to((*(self.fence.return_point or (home.north_m, home.east_m)), height))

    def _announce(self) -> None:
        """Say what the fence is now."""
        fence = self.fence
        circles = sum(area.radius > 0.0 for area in fence.areas)
        parts = [(len(fence.areas) - circles, "polygon"), (circles, "circle")]
        what = " and ".join(counted(n, noun) for n, noun in parts if n) or "no area"
        text = f"fence of {what} " + ("in force" if self.enabled else "held, FENCE_ENABLE is 0")
        self._say(dialect.MAV_SEVERITY_INFO, text)

    def _refuse(self, text: str) -> int:
        self._say(dialect.MAV_SEVERITY_WARNING, f"Fence: {text}")
        return dialect.MAV_RESULT_DENIED

"""A telemetry log as the source of the dashboard: play, pause, seek, faster and slower."""

from collections.abc import Callable, Sequence
from typing import NoReturn

from gcs.station.fleet_state import FleetState
from gcs.station.notifications import Notification
from gcs.station.passive_observer import PassiveObserver
from gcs.tui.event_log import EventLog
from gcs.tui.fault_history import FaultHistory
from gcs.tui.log_clock import read_clock
from mavlink_defs.framing.frames import of_mavlink1, parse

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)

_TICK_S = 0.2
_MAX_FRAMES = 1500  # at a time, so that keys never wait for long


class Playback:
    """Plays frames into a fleet state of its own; a `Source` that cannot act.

    Its positions are simulated time where the log has it, however fast the fleet flew; ages and
    rates are as in the log. To go back it restarts from the beginning. A long way takes several
    calls of `advance`, so that the screen stays alive meanwhile.

    Attributes:
        playing: Whether time passes.
        speed: Factor of real time.
        clock: Which clock positions are on, and the log's frames on it.
        begin_s: Position of the first frame [s].
        end_s: Position of the last frame [s].
        position_s: The position [s].
        target_s: Position to reach [s].
    """

    read_only = "this is a log"
    offers_files = True

    def __init__(
        self, title: str, frames: Sequence[tuple[int, bytes]], clock: Callable[[], float]
    ) -> None:
        """Prepare to play from the beginning.

        Args:
            title: What is shown as the connection.
            frames: Time [µs since 1970] and frame of each record, at least one.
            clock: Gives the time [s].
        """
        self.title = title
        self.event_log, self.fault_history = EventLog(), FaultHistory((0, 0))
        self.playing, self.speed = True, 1.0
        self.clock = read_clock(frames)
        self.begin_s, self.end_s = self.clock.positions_s[0], self.clock.positions_s[-1]
        self.target_s = self.begin_s
        self._frames, self._now = frames, clock
        self._advanced_at = clock()
        self._restart()

    def _restart(self) -> None:
        self._fleet = FleetState()
        self._overheard = PassiveObserver(self._fleet)
        self._next = 0
        self.position_s = self.begin_s
        self._tick_due = self._heard_at = self.clock.heard_s[0]
        self.event_log.clear()
        self.fault_history.forget()

    # as a source

    @property
    def fleet(self) -> FleetState:
        """The state of the vehicles at the position."""
        return self._fleet

    def now(self) -> float:
        """Return when the position was heard, as time since 1970 [s]."""
        return self._heard_at

    def paced_by(self) -> float:
        """Return the position [s]."""
        return self.position_s

    def since_1970(self, at: float) -> float:
        """Return the time: the clock of a log counts from 1970."""
        return at

    def vehicle(self, system: int) -> NoReturn:
        """Raise KeyError: a log has no vehicles to talk to."""
        raise KeyError(system)

    # as a player

    @property
    def is_seeking(self) -> bool:
        """Whether the position is still before the target, or frames of it are due."""
        return self.position_s < self.target_s or self._is_due()

    def seek(self, position_s: float) -> None:
        """Set another target."""
        self.target_s = min(max(position_s, self.begin_s), self.end_s)
        if self.target_s < self.position_s:
            self._restart()

    def change_speed(self, step: int) -> None:
        """Play faster or slower."""
        at = min(range(len(SPEEDS)), key=lambda i: abs(SPEEDS[i] - self.speed))
        self.speed = SPEEDS[min(max(at + step, 0), len(SPEEDS) - 1)]

    def advance(self) -> bool:
        """Advance by the clock; call it often. Return whether the target is reached."""
        now = self._now()
        if self.playing and not self.is_seeking:
            self.target_s = min(self.target_s + (now - self._advanced_at) * self.speed, self.end_s)
            self.playing = self.target_s < self.end_s
        self._advanced_at = now
        for _ in range(_MAX_FRAMES):
            if not self._step():
                break
        return not self.is_seeking

    def _is_due(self) -> bool:
        positions = self.clock.positions_s
        return self._next < len(positions) and positions[self._next] <= self.target_s

    def _step(self) -> bool:
        """Take in the next frame, or note that there is none before the target."""
        is_due = self._is_due()
        if is_due:
            self._next += 1
            self._go_to(self.clock.positions_s[self._next - 1])
            self._receive(self._frames[self._next - 1][1])
        else:
            self._go_to(self.target_s)
        return is_due

    def _go_to(self, position_s: float) -> None:
        self.position_s = position_s
        heard_at = self.clock.heard_at(position_s, self._next)
        while self._tick_due <= heard_at:
            self._log(self._fleet.handle_timer(self._tick_due))
            self._tick_due += _TICK_S
        self._heard_at = heard_at

    def _receive(self, frame: bytes) -> None:
        message = parse(of_mavlink1(frame) or frame)
        if message is not None:
            now = self.now()
            self._log(self._fleet.receive(message, now))
            self._log(self._overheard.receive(message, now))

    def _log(self, notifications: list[Notification]) -> None:
        for one in notifications:
            state = self._fleet.vehicles.get(one.system)
            self.event_log.receive(one, one.at, state.time_s if state else None)
            self.fault_history.receive(one, one.at)

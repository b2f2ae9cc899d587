"""A telemetry log as the source of the dashboard: play, pause, seek, faster and slower."""

from collections.abc import Callable, Sequence
from typing import NoReturn

from gcs.station.fleet_state import FleetState
from gcs.station.notifications import Notification
from gcs.station.passive_observer import PassiveObserver
from gcs.tui.event_log import EventLog
from gcs.tui.fault_history import FaultHistory
from mavlink_defs.framing.frames import parse

__all__ = ["SPEEDS", "Playback"]

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)

_TICK_S = 0.2
_MAX_FRAMES = 1500  # at a time, so that keys never wait for long


class Playback:
    """Plays frames into a fleet state of its own; a `Source` that cannot act.

    To go back it restarts from the beginning. A long way takes several calls of `advance`, so
    that the screen stays alive meanwhile.

    Attributes:
        playing: Whether time passes.
        speed: Factor of real time.
        wanted_s: Wanted position [s from the beginning].
    """

    can_act = False

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
        self.playing, self.speed, self.wanted_s = True, 1.0, 0.0
        self._frames, self._clock = frames, clock
        self._begin_s = min(time_us for time_us, _ in frames) / 1e6
        self.length_s = max(time_us for time_us, _ in frames) / 1e6 - self._begin_s
        self._advanced_at = clock()
        self._restart()

    def _restart(self) -> None:
        self._fleet = FleetState()
        self._overheard = PassiveObserver(self._fleet)
        self._next = 0
        self._tick_due = self.position_s = 0.0
        self.event_log.clear()
        self.fault_history.forget()

    # as a source

    @property
    def fleet(self) -> FleetState:
        """The state of the vehicles at the position."""
        return self._fleet

    def now(self) -> float:
        """Return the position as time since 1970 [s]."""
        return self._begin_s + self.position_s

    def since_1970(self, at: float) -> float:
        """Return the time: the clock of a log counts from 1970."""
        return at

    def vehicle(self, system: int) -> NoReturn:
        """Raise KeyError: a log has no vehicles to talk to."""
        raise KeyError(system)

    # as a player

    @property
    def is_seeking(self) -> bool:
        """Whether the position is still before the wanted one."""
        return self.position_s < self.wanted_s

    def seek(self, position_s: float) -> None:
        """Set another wanted position."""
        self.wanted_s = min(max(position_s, 0.0), self.length_s)
        if self.wanted_s < self.position_s:
            self._restart()

    def change_speed(self, step: int) -> None:
        """Play faster or slower."""
        at = min(range(len(SPEEDS)), key=lambda i: abs(SPEEDS[i] - self.speed))
        self.speed = SPEEDS[min(max(at + step, 0), len(SPEEDS) - 1)]

    def advance(self) -> bool:
        """Advance by the clock; call it often. Return whether the wanted position is reached."""
        now = self._clock()
        if self.playing and not self.is_seeking:
            self.wanted_s = min(
                self.wanted_s + (now - self._advanced_at) * self.speed, self.length_s
            )
            self.playing = self.wanted_s < self.length_s
        self._advanced_at = now
        for _ in range(_MAX_FRAMES):
            if not self._step():
                break
        return not self.is_seeking

    def _step(self) -> bool:
        """Take in the next frame, or note that there is none before the wanted position."""
        if self._next < len(self._frames):
            time_us, frame = self._frames[self._next]
            at = max(time_us / 1e6 - self._begin_s, self.position_s)
            if at <= self.wanted_s:
                self._next += 1
                self._go_to(at)
                self._receive(frame)
                return True
        self._go_to(self.wanted_s)
        return False

    def _go_to(self, at: float) -> None:
        while self._tick_due <= at:
            self._tell(self._fleet.handle_timer(self._begin_s + self._tick_due))
            self._tick_due += _TICK_S
        self.position_s = at

    def _receive(self, frame: bytes) -> None:
        message = parse(frame)
        if message is not None:
            now = self.now()
            self._tell(self._fleet.receive(message, now))
            self._tell(self._overheard.receive(message, now))

    def _tell(self, notifications: list[Notification]) -> None:
        for one in notifications:
            state = self._fleet.vehicles.get(one.system)
            self.event_log.receive(one, one.at, state.time_s if state else None)
            self.fault_history.receive(one, one.at)

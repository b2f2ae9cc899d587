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

    To go back it begins anew. Going far takes several calls of `advance`, so that the screen
    stays alive meanwhile.

    Attributes:
        playing: Whether it goes on by itself.
        speed: Times as fast as it happened.
        wanted_s: Where it shall be [s from the begin].
    """

    can_act = False

    def __init__(
        self, title: str, frames: Sequence[tuple[int, bytes]], clock: Callable[[], float]
    ) -> None:
        """Prepare it.

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
        self._looked_at = clock()
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
        """What the log told up to now."""
        return self._fleet

    def now(self) -> float:
        """Where it is, as time since 1970 [s]."""
        return self._begin_s + self.position_s

    def since_1970(self, at: float) -> float:
        """The clock of a log counts from 1970."""
        return at

    def vehicle(self, system: int) -> NoReturn:
        """A log has no vehicles to talk to."""
        raise KeyError(system)

    # as a player

    @property
    def is_seeking(self) -> bool:
        """Whether it is on its way to another place."""
        return self.position_s < self.wanted_s

    def seek(self, position_s: float) -> None:
        """Go to another place."""
        self.wanted_s = min(max(position_s, 0.0), self.length_s)
        if self.wanted_s < self.position_s:
            self._restart()

    def change_speed(self, step: int) -> None:
        """Go faster or slower."""
        at = min(range(len(SPEEDS)), key=lambda i: abs(SPEEDS[i] - self.speed))
        self.speed = SPEEDS[min(max(at + step, 0), len(SPEEDS) - 1)]

    def advance(self) -> bool:
        """Do what is due by the clock; call it often. Tells whether it is where it shall be."""
        now = self._clock()
        if self.playing and not self.is_seeking:
            self.wanted_s = min(self.wanted_s + (now - self._looked_at) * self.speed, self.length_s)
            self.playing = self.wanted_s < self.length_s
        self._looked_at = now
        for _ in range(_MAX_FRAMES):
            if not self._step():
                break
        return not self.is_seeking

    def _step(self) -> bool:
        """Take in the next frame, or note that there is none before the wanted place."""
        if self._next < len(self._frames):
            time_us, frame = self._frames[self._next]
            at = max(time_us / 1e6 - self._begin_s, self.position_s)
            if at <= self.wanted_s:
                self._next += 1
                self._go_to(at)
                self._take(frame)
                return True
        self._go_to(self.wanted_s)
        return False

    def _go_to(self, at: float) -> None:
        while self._tick_due <= at:
            self._tell(self._fleet.handle_timer(self._begin_s + self._tick_due))
            self._tick_due += _TICK_S
        self.position_s = at

    def _take(self, frame: bytes) -> None:
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

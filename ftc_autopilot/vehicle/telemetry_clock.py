"""The clock that intervals of telemetry count.

Whoever reads telemetry lives by the wall clock. A lockstep flight passes simulated time as fast as
the machine allows, perhaps fifty times as fast: at simulated rates, vehicles and ground stations
would spend most of the machine on messages that nobody can follow.
"""

from ftc_autopilot.config import TelemetryClockKind
from ftc_autopilot.hot.hot_state import HotState
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP

_MIN_PACE = 1e-3


class TelemetryClock:
    """Counts wall time until simulated time runs, then simulated time.

    In lockstep, of the kind "wall", it counts the slower of both, so that a flight slower than
    real time does not send more than at simulated rates either.
    """

    def __init__(self, kind: TelemetryClockKind, hot: HotState) -> None:
        self._kind, self._hot = kind, hot
        self._wall_us = self._simulated_us = self._slower_us = 0
        self._pace = 1.0  # of this clock, relative to the wall clock

    def read_us(self, now: float) -> int:
        """Return the time on this clock [µs].

        Args:
            now: Wall-clock time [s], not before the last call.
        """
        wall_us, simulated_us = round(now * 1e6), self._hot.time_us
        wall_passed_us = wall_us - self._wall_us
        simulated_passed_us = max(simulated_us - self._simulated_us, 0)  # a plant starts again at 0
        self._wall_us, self._simulated_us = wall_us, simulated_us
        if not self._hot.running:
            self._slower_us = wall_us
            return wall_us
        passed_us = min(wall_passed_us, simulated_passed_us)
        self._slower_us += passed_us
        if wall_passed_us > 0:
            self._pace = passed_us / wall_passed_us
        return self._slower_us if self.is_slower_of_both else simulated_us

    def wait_s(self, us: int) -> float:
        """Return the expected wall time until the slower of both clocks shows a time [µs]."""
        return max(us - self._slower_us, 0) * 1e-6 / max(self._pace, _MIN_PACE)

    @property
    def is_slower_of_both(self) -> bool:
        """Whether both clocks count, so that simulated time alone makes no message due."""
        return self._kind == "wall" and bool(self._hot.flags & FTC_SIM_FLAGS_LOCKSTEP)

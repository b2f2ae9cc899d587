"""The text of an autopilot that was restarted and resumes its flight."""

from collections.abc import Iterator

from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from mavlink_defs import dialect


class Resumption:
    """Reports once from which checkpoint the flight resumes, and how old it is."""

    def __init__(self, hot: HotState) -> None:
        self._hot = hot
        self._resumed_us: int | None = None  # simulated time of the checkpoint, until reported

    def resume(self) -> None:
        """Note that the flight resumes from where the records are now."""
        self._resumed_us = self._hot.step * self._hot.step_us

    def changes(self) -> Iterator[Change]:
        """Yield the resumption once, when the plant has been heard."""
        if self._resumed_us is None or self._hot.heard_s == 0.0:
            return
        resumed_us, self._resumed_us = self._resumed_us, None
        text = "autopilot restarted: mission, parameters, mode and arming restored"
        if resumed_us >= 0:
            age_s = (self._hot.time_us - resumed_us) * 1e-6
            text += f", and the flight of {resumed_us * 1e-6:.3f} s, {age_s:.3f} s old"
        yield Change("restart", dialect.MAV_SEVERITY_WARNING, text)

"""The clocks that a vehicle tells: time since boot, and simulated time in its private messages."""

from mavlink_defs import dialect

_BACK_IN_TIME_S = 1.0  # only messages older than the newest for this long: a restart
SIMULATED_TIME = {
    dialect.MAVLINK_MSG_ID_FTC_TRACKING,
    dialect.MAVLINK_MSG_ID_FTC_EVENTS,
    dialect.MAVLINK_MSG_ID_FTC_ADAPTATION,
    dialect.MAVLINK_MSG_ID_FTC_DIAGNOSIS,
    dialect.MAVLINK_MSG_ID_FTC_FORMATION,
    dialect.MAVLINK_MSG_ID_FTC_DROPS,
}
"""Message ids of private messages: their `time_boot_ms` is simulated time."""


class ToldClock:
    """One of a vehicle's clocks.

    Attributes:
        newest_ms: Its newest time [ms], -1 before the first one.
    """

    def __init__(self) -> None:
        self.newest_ms = -1
        self._back_since: float | None = None

    def goes_back(self, time_ms: int, now: float) -> bool:
        """Process a time of the clock; return whether it stays behind the newest one.

        Messages that are merely late do so for a moment only.
        """
        if time_ms >= self.newest_ms:
            self.newest_ms, self._back_since = time_ms, None
        elif self._back_since is None:
            self._back_since = now
        return self._back_since is not None and now - self._back_since > _BACK_IN_TIME_S

"""What vehicles stream on request: their private messages, and the clock in them."""

from mavlink_defs import dialect

PRIVATE = frozenset(
    number
    for number, kind in dialect.mavlink_map.items()
    if kind.msgname.startswith("FTC_") and "time_boot_ms" in kind.fieldnames
)
"""Message ids of private telemetry; its `time_boot_ms` is simulated time."""

REQUESTED_S: dict[int, float] = {
    **dict.fromkeys(sorted(PRIVATE - {dialect.MAVLINK_MSG_ID_FTC_EVENTS}), 0.5),
    dialect.MAVLINK_MSG_ID_FTC_TRACKING: 0.1,
    dialect.MAVLINK_MSG_ID_FTC_FORMATION: 0.2,
    dialect.MAVLINK_MSG_ID_FTC_DROPS: 2.0,
    dialect.MAVLINK_MSG_ID_WIND_COV: 1.0,
    dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 0.5,
    dialect.MAVLINK_MSG_ID_FTC_EVENTS: 0.2,  # the last one: once it arrives, all do
}
"""Messages that displays request, private ones, wind and way; their intervals [s]."""

_BACK_IN_TIME_S = 1.0  # only messages older than the newest for this long: a restart


class ReportedClock:
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

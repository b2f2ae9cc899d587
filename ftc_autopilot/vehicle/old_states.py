"""Texts of an autopilot that acts on old states, once for each time that it does."""

from collections.abc import Iterator

from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from mavlink_defs import dialect
from mavlink_defs.constants import OLD_STATE_S

_SUBJECT = "old states"


class OldStates:
    """Tells when the states acted on become old, and when all of the last second were new again."""

    def __init__(self, hot: HotState) -> None:
        self._hot = hot
        self._oldest_s = 0.0  # since they became old; 0: they are new

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call."""
        oldest_s = self._hot.oldest_state_us / 1e6
        if oldest_s > OLD_STATE_S:
            if not self._oldest_s:
                why = "too little processor time, or states lost"
                text = f"acted on a state {oldest_s:.3f} s old: {why}"
                yield Change(_SUBJECT, dialect.MAV_SEVERITY_WARNING, text)
            self._oldest_s = max(self._oldest_s, oldest_s)
        elif self._oldest_s:
            text = f"acts on new states again; the oldest was {self._oldest_s:.3f} s old"
            self._oldest_s = 0.0
            yield Change(_SUBJECT, dialect.MAV_SEVERITY_NOTICE, text)

"""The telemetry of one vehicle over the last minutes, for plots."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

ROW = (
    ("time_s", "f8"),  # simulated time
    ("actual", "f8", 4),  # airspeed [m/s], roll, pitch, yaw [deg]
    ("reference", "f8", 4),  # the same, filtered reference
    ("sync_error", "f8", 4),  # (31), (32)
    ("held", "f8", 4),  # commands held: aileron, elevator, rudder, throttle [share of limit]
    ("events", "f8", 4),  # events so far, same order
    ("predicted_exit", "f8", 4),  # time until the output leaves its tube [s], same order
    ("position", "f8", 3),  # north, east, down [m]
)
"""Fields of one row; NaN where a message has not arrived yet."""

_ROWS = 6000  # ten minutes at 10 Hz


class History:
    """The latest rows, in a ring buffer, which is made for the first one."""

    def __init__(self) -> None:
        self._buffer: np.ndarray | None = None
        self._count = 0

    @property
    def _rows(self) -> "np.ndarray":
        if self._buffer is None:
            import numpy as np  # once there is telemetry: commands need not wait for it

            self._buffer = np.empty(_ROWS, list(ROW))  # memory is committed as it fills
        return self._buffer

    def __len__(self) -> int:
        return min(self._count, _ROWS)

    def add(self, row: tuple[object, ...]) -> None:
        """Append a row, its values in the order of `ROW`."""
        self._rows[self._count % _ROWS] = row
        self._count += 1

    def rows(self, span_s: float = math.inf) -> "np.ndarray":
        """Return a copy of the rows of the last `span_s` of simulated time, oldest first."""
        import numpy as np

        if self._count <= _ROWS:
            rows = self._rows[: self._count]
        else:
            rows = np.roll(self._rows, -(self._count % _ROWS))
        newest_s = rows["time_s"][-1] if len(rows) else 0.0
        return np.array(rows[rows["time_s"] >= newest_s - span_s])

"""Events as a table: one row for each actuator channel that a trigger made an autopilot send."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from mavlink_defs.constants import ACTUATORS

Events: TypeAlias = Mapping[str, np.ndarray]
"""Columns of equal length, as `events_of` returns them."""


def events_of(
    signals: np.ndarray, first: int, uav_ids: Sequence[int], step_us: int
) -> dict[str, np.ndarray]:
    """Return the events of consecutive steps as columns of equal length, ordered by time.

    Args:
        signals: Shape (steps, n), dtype `ftc_autopilot.control.controller.SIGNALS`.
        first: Number of the first step.
        uav_ids: System ids, length n.
        step_us: Control period [µs].

    Returns:
        `uav` (system id), `channel` (number as in `mavlink_defs.faults.ACTUATORS`), `step`,
        `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    masks = signals["events"]
    row, uav = np.nonzero(masks)
    bits = masks[row, uav, None] >> np.arange(len(ACTUATORS), dtype=np.uint8) & 1
    which, channel = np.nonzero(bits)
    row, uav = row[which], uav[which]
    step = first + row
    return {
        "uav": np.array(uav_ids)[uav],
        "channel": channel,
        "step": step,
        "time_s": step * step_us / 1e6,
        "value": signals["held"][row, uav, channel],
    }

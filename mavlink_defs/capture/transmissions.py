"""Control transmissions of one UAV, counted per actuator channel from its messages alone.

A channel had an event in a HIL_ACTUATOR_CONTROLS when its value differs from the message before;
in the first, all had one. A message in which no channel had one is a repeat.
"""

from collections.abc import Sequence

import numpy as np

from mavlink_defs.capture.saving import saving
from mavlink_defs.capture.tap_counts import NEVER
from mavlink_defs.capture.tap_report import ChannelReport, UavReport
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_ftc_events_message


def counted(link: str, system: int, row: np.void, period_us: int | None) -> UavReport:
    """Return the transmissions of a UAV, compared with periodic sending.

    Args:
        link: Where they were counted.
        system: System id of the UAV.
        row: The counts, dtype `tap_counts.UAV`.
        period_us: The control period, for links without FTC_SIM_STATE [µs].
    """
    periods, events = _periods(row, period_us), [int(n) for n in row["events"]]
    return UavReport(
        link=link,
        system=system,
        reported=False,
        periods=periods,
        saving=saving(sum(events), periods),
        messages=int(row["messages"]),
        repeats=int(row["repeats"]),
        channels=_channels(periods, events, min_intervals_s(row)),
    )


def min_intervals_s(row: np.void) -> list[float | None]:
    """Return the shortest interval of each channel [s, simulated]; None with fewer than two.

    Args:
        row: The counts of a UAV, dtype `tap_counts.UAV`.
    """
    return [None if us == NEVER else int(us) / 1e6 for us in row["min_interval_us"]]


def _periods(row: np.void, period_us: int | None) -> int | None:
    """Return the control periods that passed; None if unknown."""
    if row["has_steps"]:
        return int(row["steps_before"] + row["last_step"] - row["first_step"] + 1)
    if period_us is None or not row["messages"]:
        return None
    return int(row["last_us"] - row["first_us"]) // period_us + 1


def reported(link: str, message: MAVLink_ftc_events_message) -> UavReport:
    """Return the same as an autopilot's own FTC_EVENTS has it.

    A difference: repeats are events sent again here, and messages that carry nothing else when
    they are counted.
    """
    shortest = [
        us / 1e6 if n > 1 else None
        for us, n in zip(message.min_interval_us, message.events, strict=True)
    ]
    return UavReport(
        link=link,
        system=message.get_srcSystem(),
        reported=True,
        periods=message.steps,
        saving=saving(sum(message.events), message.steps),
        messages=message.messages,
        repeats=sum(message.repeats),
        channels=_channels(message.steps, message.events, shortest),
    )


def _channels(
    periods: int | None, events: Sequence[int], min_interval_s: Sequence[float | None]
) -> dict[str, ChannelReport]:
    return {
        name: ChannelReport(
            events=n, saving=saving(n, periods, channels=1), min_interval_s=shortest_s
        )
        for name, n, shortest_s in zip(ACTUATORS, events, min_interval_s, strict=True)
    }

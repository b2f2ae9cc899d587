"""Control transmissions of one UAV, counted per actuator channel from its messages alone.

A channel had an event in a HIL_ACTUATOR_CONTROLS when its value differs from the message before;
in the first, all had one. A message in which no channel had one is a repeat.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from mavlink_defs.capture.tap_report import ChannelReport, UavReport
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_ftc_events_message

__all__ = ["Transmissions", "reported", "saving"]


@dataclass
class Transmissions:
    """Counts of one UAV on one link; lists are per channel, in the order of ACTUATORS."""

    messages: int = 0
    repeats: int = 0
    events: list[int] = field(default_factory=lambda: [0] * len(ACTUATORS))
    min_interval_us: list[int | None] = field(default_factory=lambda: [None] * len(ACTUATORS))
    _controls: tuple[float, ...] | None = None
    _event_us: list[int | None] = field(default_factory=lambda: [None] * len(ACTUATORS))
    _span_us: tuple[int, int] | None = None
    _run: int | None = None
    _steps: tuple[int, int] | None = None
    _steps_before: int = 0  # of flights that are over

    def step(self, step: int, run: int) -> None:
        """Note a control period, by its FTC_SIM_STATE; another run is another flight."""
        if self._steps is None or run != self._run:
            self._run, self._steps_before = run, self._counted_steps
            self._steps = (step, step)
            self._controls = None
            self._event_us = [None] * len(ACTUATORS)
        else:
            first, last = self._steps
            self._steps = (min(first, step), max(last, step))

    def transmission(self, time_us: int, controls: tuple[float, ...]) -> None:
        """Count one HIL_ACTUATOR_CONTROLS."""
        before = self._controls
        changed = [c for c, x in enumerate(controls) if before is None or x != before[c]]
        for c in changed:
            self.events[c] += 1
            last_us, self._event_us[c] = self._event_us[c], time_us
            if last_us is not None:
                shortest = self.min_interval_us[c]
                interval = time_us - last_us
                self.min_interval_us[c] = interval if shortest is None else min(shortest, interval)
        self.messages += 1
        self.repeats += not changed
        self._controls = controls
        first, last = self._span_us or (time_us, time_us)
        self._span_us = (min(first, time_us), max(last, time_us))

    def periods(self, period_us: int | None) -> int | None:
        """Return the control periods that passed; None if unknown.

        Args:
            period_us: The control period, for links without FTC_SIM_STATE [µs].
        """
        if self._steps is not None:
            return self._counted_steps
        if period_us is None or self._span_us is None:
            return None
        return (self._span_us[1] - self._span_us[0]) // period_us + 1

    def report(self, link: str, system: int, period_us: int | None) -> UavReport:
        """Return everything counted, compared with periodic sending.

        Args:
            link: Where it was counted.
            system: System id of the UAV.
            period_us: As of `periods`.
        """
        periods = self.periods(period_us)
        return UavReport(
            link=link,
            system=system,
            reported=False,
            periods=periods,
            saving=saving(sum(self.events), periods),
            messages=self.messages,
            repeats=self.repeats,
            channels=_channels(periods, self.events, self.min_interval_us),
        )

    @property
    def _counted_steps(self) -> int:
        first, last = self._steps or (0, -1)
        return self._steps_before + last - first + 1


def reported(link: str, message: MAVLink_ftc_events_message) -> UavReport:
    """Return the same as an autopilot's own FTC_EVENTS has it.

    A difference: repeats are events sent again here, and messages that carry nothing else when
    they are counted.
    """
    shortest = [
        us if n > 1 else None for us, n in zip(message.min_interval_us, message.events, strict=True)
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


def saving(events: int, periods: int | None, channels: int = len(ACTUATORS)) -> float | None:
    """Return the share of a periodic sender's transmissions that were not sent.

    Args:
        events: Transmissions.
        periods: Control periods in which each channel would have been sent; None if unknown.
        channels: Actuator channels that `events` counts.

    Returns:
        The share; None if there was no period, or none is known.
    """
    return 1.0 - events / (periods * channels) if periods else None


def _channels(
    periods: int | None, events: Sequence[int], min_interval_us: Sequence[int | None]
) -> dict[str, ChannelReport]:
    return {
        name: ChannelReport(
            events=n,
            saving=saving(n, periods, channels=1),
            min_interval_s=None if us is None else us / 1e6,
        )
        for name, n, us in zip(ACTUATORS, events, min_interval_us, strict=True)
    }

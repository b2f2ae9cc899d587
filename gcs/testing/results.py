"""The result of a flight in a test: plain values, and assertions that report where they fail.

Transmissions are those that the tap counted on the wire. A flight in one process has no wire; there
they are the events that the controllers recorded.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gcs.results.figures import UAV_FIGURES, UavSummary
from gcs.results.quantities import QUANTITIES, UNITS, in_degrees
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.results.summary_parts import ChannelSummary
from gcs.scenario.model import Scenario
from mavlink_defs.capture.saving import saving
from mavlink_defs.capture.tap_report import ChannelReport, TapReport
from mavlink_defs.constants import ACTUATORS


class Errors(NamedTuple):
    """One value for each tracked quantity."""

    airspeed_m_s: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


@dataclass(frozen=True)
class Channel:
    """The transmissions of one actuator channel of one UAV.

    Attributes:
        uav: System id.
        name: "aileron", "elevator", "rudder" or "throttle".
        sent: Transmissions.
        min_interval_s: Shortest time between two of them [s]; None with fewer than two.
        saving: Share of the periodic sender's transmissions that were not sent.
        times_s: When the controller had an event [s], from its recording.
        claimed: Transmissions that the vehicle reports.
        repeats: Transmissions repeated because the plant had not applied them.
    """

    uav: int
    name: str
    sent: int
    min_interval_s: float | None
    saving: float | None
    times_s: np.ndarray
    claimed: int
    repeats: int

    def __repr__(self) -> str:
        return f"<{self.name} of UAV {self.uav}: {self.sent} sent>"

    def assert_dwell(self, min_s: float) -> None:
        """Assert that no two transmissions are closer than this [s]."""
        __tracebackhide__ = True
        if self.min_interval_s is None or self.min_interval_s >= min_s * (1.0 - 1e-9):
            return
        gaps = np.diff(self.times_s)
        short = int(np.count_nonzero(gaps < min_s * (1.0 - 1e-9)))
        where = ""
        if short:
            k = int(np.argmin(gaps))
            where = f" between {self.times_s[k]:.3f} s and {self.times_s[k + 1]:.3f} s; "
            where += f"{short} of {len(gaps)} intervals are too short"
        raise AssertionError(
            f"UAV {self.uav} {self.name}: expected transmissions at least {1e3 * min_s:g} ms "
            f"apart, got {1e3 * self.min_interval_s:g} ms{where}"
        )


class UavFlight:
    """One UAV's part of a flight.

    Attributes:
        id: Its system id.
        summary: Its part of `summary.json`.
        figures: Every figure by its name, as in the results of a campaign.
        channels: By name; also as `aileron`, `elevator`, `rudder`, `throttle`.
        sent: Transmissions of all channels.
        messages: HIL_ACTUATOR_CONTROLS that carried them; several may travel in one.
        saving: Share of the periodic sender's transmissions that were not sent.
        attitude_lost_at_s: When roll or pitch was more than 90° off first [s]; None if never.
        heading_lost_at_s: The same for yaw.
        lowest_altitude_m: Least height above the ground [m]; below 0 it has hit the ground.
        missing_steps: Steps at which no state reached its autopilot.
    """

    def __init__(
        self, recording: Recording, i: int, summary: UavSummary, wire: TapReport | None
    ) -> None:
        self.id = summary.id
        self.summary = summary.to_json()
        self.figures = {figure.name: figure.of(summary) for figure in UAV_FIGURES}
        self.attitude_lost_at_s = summary.attitude_lost_at_s
        self.heading_lost_at_s = summary.heading_lost_at_s
        self.lowest_altitude_m = summary.lowest_altitude_m
        self.missing_steps = summary.missing_steps
        self._time_s, self._errors = recording.time_s, recording.error("reference")[:, i]
        counted: Mapping[str, ChannelSummary | ChannelReport] = {}
        self.messages = 0
        if wire is None:
            counted, self.messages = summary.channels, summary.actuator_messages
        elif (seen := wire.uav("plant", self.id)) is not None:
            counted, self.messages = seen.channels, seen.messages
        events = recording.signals["events"][:, i]
        steps = summary.active_steps
        self.channels = {}
        for c, name in enumerate(ACTUATORS):
            claimed, channel = summary.channels[name], counted.get(name)
            sent = channel.events if channel else 0
            self.channels[name] = Channel(
                uav=self.id,
                name=name,
                sent=sent,
                min_interval_s=channel.min_interval_s if channel else None,
                saving=saving(sent, steps, channels=1),
                times_s=recording.time_s[events & (1 << c) > 0],
                claimed=claimed.events,
                repeats=claimed.repeats,
            )
        self.sent = sum(channel.sent for channel in self.channels.values())
        self.saving = saving(self.sent, steps)

    def __repr__(self) -> str:
        return f"<UAV {self.id}>"

    @property
    def aileron(self) -> Channel:
        """Its aileron."""
        return self.channels["aileron"]

    @property
    def elevator(self) -> Channel:
        """Its elevator."""
        return self.channels["elevator"]

    @property
    def rudder(self) -> Channel:
        """Its rudder."""
        return self.channels["rudder"]

    @property
    def throttle(self) -> Channel:
        """Its throttle."""
        return self.channels["throttle"]

    def max_error(self, after_s: float = 0.0, until_s: float = math.inf) -> Errors:
        """Return the largest errors against the filtered reference in a window [s], ends included.

        Errors are the true state's; steps flown disarmed have none. NaN if no step has.
        """
        _, errors = self._within(after_s, until_s)
        worst = errors.max(axis=0) if len(errors) else [math.nan] * len(QUANTITIES)
        return Errors(*map(float, worst))

    def assert_error_below(
        self,
        *,
        airspeed_m_s: float = math.inf,
        roll_deg: float = math.inf,
        pitch_deg: float = math.inf,
        yaw_deg: float = math.inf,
        after_s: float = 0.0,
        until_s: float = math.inf,
    ) -> None:
        """Assert that errors against the filtered reference stay below bounds in a window [s]."""
        __tracebackhide__ = True
        times, errors = self._within(after_s, until_s)
        window = f"after {after_s:g} s" if until_s == math.inf else f"in [{after_s:g}, {until_s:g}]"
        if len(times) == 0:
            flown_s = float(self._time_s[-1]) if len(self._time_s) else 0.0
            raise AssertionError(f"UAV {self.id}: nothing flown {window}, only {flown_s:.3f} s")
        complaints = []
        bounds = (airspeed_m_s, roll_deg, pitch_deg, yaw_deg)
        for c, (name, bound) in enumerate(zip(QUANTITIES, bounds, strict=True)):
            unit = UNITS[name]
            beyond = np.flatnonzero(~(errors[:, c] < bound))
            if bound < math.inf and len(beyond):
                worst = int(np.argmax(errors[:, c]))
                complaints.append(
                    f"UAV {self.id} {name} error: expected below {bound:g} {unit} {window}, "
                    f"got {errors[worst, c]:.3g} {unit} at {times[worst]:.3f} s "
                    f"({len(beyond)} of {len(times)} steps, first at {times[beyond[0]]:.3f} s)"
                )
        if complaints:
            raise AssertionError("\n".join(complaints))

    def _within(self, after_s: float, until_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times and absolute errors [m/s, deg] in a window, where there are any."""
        here = (self._time_s >= after_s) & (self._time_s <= until_s)
        here &= np.isfinite(self._errors).all(axis=1)
        return self._time_s[here], in_degrees(np.abs(self._errors[here]))


class FlightResult:
    """One finished flight.

    Attributes:
        scenario: As it was flown.
        recording: Everything at full rate; arrays are read-only.
        summary: The content of `summary.json`.
        wire: The content of wire.json, counted between autopilots and plant; None in process.
        folder: Configurations, logs and tlog of the processes; None in process.
        saving: Share of the periodic sender's transmissions that were not sent.
        completed: Whether it was flown until the scenario's end.
        loss: Why the flight was lost: an aircraft, the link to an autopilot, or a law that gave no
            finite command; None if it was not.
    """

    def __init__(
        self,
        scenario: Scenario,
        recording: Recording,
        wire: TapReport | None = None,
        folder: Path | None = None,
    ) -> None:
        self.scenario, self.recording = scenario, recording
        self.wire = None if wire is None else wire.to_json()
        self.folder = folder
        summary = summarise(recording, scenario)
        for array in (recording.states, recording.applied, recording.signals, recording.repeats):
            array.flags.writeable = False
        self.summary = summary.to_json()
        self.loss = summary.loss if summary.control_failed else recording.loss
        self.completed = summary.completed
        self.uavs = {
            uav.id: UavFlight(recording, i, uav, wire) for i, uav in enumerate(summary.uavs)
        }
        sent = sum(uav.sent for uav in self.uavs.values())
        steps = sum(uav.active_steps for uav in summary.uavs)
        self.saving = saving(sent, steps)

    def __repr__(self) -> str:
        return f"<flight of {self.scenario.name!r}, {self.duration_s:g} s>"

    @property
    def duration_s(self) -> float:
        """Simulated time flown [s]."""
        return self.recording.duration_s

    def uav(self, system: int) -> UavFlight:
        """Return one UAV, by its system id; KeyError if there is none."""
        return self.uavs[system]

    def assert_completed(self) -> None:
        """Assert that the flight reached the scenario's end."""
        __tracebackhide__ = True
        if not self.completed:
            raise AssertionError(
                f"expected a flight of {self.scenario.duration_s:g} s, got "
                f"{self.duration_s:.3f} s: {self.loss or 'it was stopped'}"
            )

    def assert_attitude_kept(self) -> None:
        """Assert that no aircraft was lost, roll and pitch stayed within 90° of the reference."""
        __tracebackhide__ = True
        self._assert_held({i: uav.attitude_lost_at_s for i, uav in self.uavs.items()}, "attitude")

    def assert_heading_kept(self) -> None:
        """Assert that no aircraft was lost, and yaw stayed within 90° of the reference."""
        __tracebackhide__ = True
        self._assert_held({i: uav.heading_lost_at_s for i, uav in self.uavs.items()}, "heading")

    def _assert_held(self, lost_at_s: dict[int, float | None], what: str) -> None:
        __tracebackhide__ = True
        complaints = [
            f"UAV {i}: expected it to keep its {what}, but it lost it at {time_s:.3f} s"
            for i, time_s in lost_at_s.items()
            if time_s is not None
        ]
        if self.loss is not None:
            complaints.append(f"expected no loss, got: {self.loss}")
        if complaints:
            raise AssertionError("\n".join(complaints))

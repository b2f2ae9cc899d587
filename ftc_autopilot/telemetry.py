"""Telemetry of one autopilot: what it streams, how often, and how each message is made.

Intervals count simulated time while it runs, so that a flight faster than real time is as
finely resolved as any, and wall-clock time while the aircraft is frozen.
"""

import math
from collections.abc import Callable

import numpy as np

from ftc_autopilot.controller import NO_INTERVAL
from ftc_autopilot.link import AutopilotLink
from ftc_autopilot.onboard import Crew
from ftc_autopilot.reference import wrap
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from sitl_plant.rigid_body import R1
from sitl_plant.vec3 import Vec3, mul, vec3

__all__ = ["DEFAULT_INTERVALS_US", "Telemetry"]

DEFAULT_INTERVALS_US = {
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: 1_000_000,
    dialect.MAVLINK_MSG_ID_ATTITUDE: 100_000,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 100_000,
    dialect.MAVLINK_MSG_ID_VFR_HUD: 200_000,
    dialect.MAVLINK_MSG_ID_FTC_TRACKING: 100_000,
    dialect.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: 100_000,
    dialect.MAVLINK_MSG_ID_FTC_EVENTS: 200_000,
    dialect.MAVLINK_MSG_ID_FTC_ADAPTATION: 500_000,
}
"""Message ids that are streamed from the start, and their intervals [µs]."""

_MIN_INTERVAL_US = 20_000


class Telemetry:
    """Makes telemetry messages from the arrays of the hot path, between its steps."""

    def __init__(self, link: AutopilotLink, crew: Crew) -> None:
        self._link = link
        self._crew = crew
        self._makers: dict[int, Callable[[], MAVLink_message]] = {
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            dialect.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            dialect.MAVLINK_MSG_ID_FTC_TRACKING: self._tracking,
            dialect.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: self._actuator_output_status,
            dialect.MAVLINK_MSG_ID_FTC_EVENTS: self._events,
            dialect.MAVLINK_MSG_ID_FTC_ADAPTATION: self._adaptation,
        }
        self._intervals_us = dict(DEFAULT_INTERVALS_US)
        self._due_us = dict.fromkeys(DEFAULT_INTERVALS_US, 0)

    def knows(self, message_id: int) -> bool:
        """Tell whether a message id can be streamed and requested."""
        return message_id in self._makers

    def set_interval(self, message_id: int, interval_us: float) -> None:
        """Set an interval [µs]: 0 restores the default, a negative one stops the message."""
        wanted: int | None = max(round(interval_us), _MIN_INTERVAL_US)
        if interval_us == 0.0:
            wanted = DEFAULT_INTERVALS_US.get(message_id)
        if wanted is None or interval_us < 0.0:
            self._intervals_us.pop(message_id, None)
            return
        self._intervals_us[message_id] = wanted
        self._due_us[message_id] = 0

    def make(self, message_id: int) -> MAVLink_message:
        """Make one message now; its id must be one that `knows` knows."""
        return self._makers[message_id]()

    def due(self, clock_us: int) -> list[MAVLink_message]:
        """Make the messages whose interval has passed on the given clock [µs]."""
        messages = []
        for message_id, interval_us in self._intervals_us.items():
            due_us = self._due_us[message_id]
            if clock_us >= due_us or due_us > clock_us + interval_us:  # or the clock was changed
                self._due_us[message_id] = clock_us + interval_us
                messages.append(self._makers[message_id]())
        return messages

    def next_due_us(self) -> int:
        """When the next message is due, on the clock of `due` [µs]; far away if none is."""
        return min((self._due_us[i] for i in self._intervals_us), default=2**62)

    @property
    def _time_ms(self) -> int:
        return int(self._link.measured[0]["time_usec"]) // 1000 % 2**32

    def _system_time(self) -> MAVLink_message:
        return dialect.MAVLink_system_time_message(0, self._time_ms)

    def _attitude(self) -> MAVLink_message:
        state = self._link.measured[0]
        roll, pitch, yaw = map(float, state["attitude"])
        rates = map(float, state["rates"])
        return dialect.MAVLink_attitude_message(self._time_ms, wrap(roll), pitch, wrap(yaw), *rates)

    def _local_position(self) -> MAVLink_message:
        state = self._link.measured[0]
        north, east, down = map(float, state["position"])
        return dialect.MAVLink_local_position_ned_message(
            self._time_ms, north, east, down, *_velocity_ned(state)
        )

    def _vfr_hud(self) -> MAVLink_message:
        state = self._link.measured[0]
        north, east, down = _velocity_ned(state)
        thrust = float(self._crew.actuators[0]["controls"][3])
        return dialect.MAVLink_vfr_hud_message(
            airspeed=float(np.linalg.norm(state["velocity"])),
            groundspeed=math.hypot(north, east),
            heading=round(math.degrees(float(state["attitude"][2]))) % 360,
            throttle=round(100.0 * thrust),
            alt=-float(state["position"][2]),
            climb=-down,
        )

    def _tracking(self) -> MAVLink_message:
        signals = self._crew.signals[0]
        return dialect.MAVLink_ftc_tracking_message(
            self._time_ms,
            _degrees(signals["reference"]),
            _degrees(signals["error"]),
            _degrees(signals["sync_error"]),
        )

    def _actuator_output_status(self) -> MAVLink_message:
        """The commands held, as HIL_ACTUATOR_CONTROLS has them."""
        held = [float(control) for control in self._crew.actuators[0]["controls"][:4]]
        return dialect.MAVLink_actuator_output_status_message(
            int(self._link.measured[0]["time_usec"]), 0b1111, held + [0.0] * 28
        )

    def _events(self) -> MAVLink_message:
        controller, clock = self._crew.controllers[0], self._link.clock[0]
        intervals = [
            min(int(steps) * int(clock["step_us"]), NO_INTERVAL)
            for steps in controller["min_interval"]
        ]
        return dialect.MAVLink_ftc_events_message(
            time_boot_ms=self._time_ms,
            steps=int(controller["steps"]),
            events=list(map(int, controller["events"])),
            min_interval_us=intervals,
            messages=int(controller["messages"]),
            repeats=list(map(int, clock["repeated"])),
            edge_changes=int(clock["edge_changes"]),
        )

    def _adaptation(self) -> MAVLink_message:
        c = self._crew.controllers[0]["proposed"]
        names = ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega")
        return dialect.MAVLink_ftc_adaptation_message(
            self._time_ms, *(float(c[name]) for name in names)
        )


def _degrees(values: np.ndarray) -> list[float]:
    """Airspeed as it is, angles in deg and within ±180°."""
    return [float(values[0]), *(math.degrees(wrap(float(angle))) for angle in values[1:4])]


def _velocity_ned(state: np.void) -> Vec3:
    return mul(R1(vec3(state["attitude"])), vec3(state["velocity"]))

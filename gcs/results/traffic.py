"""Bytes on the links of a flight, computed from its steps.

MAVLink 2 does not send the zeros at the end of a payload. So each message is laid out here as far
as its length needs, and measured. Counted is what a flight without losses sends between its first
step and its last: states, or sensors with their steps, actuator messages and neighbour messages,
each once. What a link repeats, and what is said before the start and with FTC_STEP_DONE, a tap
counts beside it.
"""

from collections.abc import Sequence

import numpy as np

from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from mavlink_defs.constants import GNSS, N_CHANNELS
from mavlink_defs.dialect import (
    FTC_NEIGHBOUR_FRAME_REFERENCE,
    FTC_SIM_FLAGS_RUNNING,
    MAV_MODE_FLAG_SAFETY_ARMED,
)
from mavlink_defs.framing.codec import (
    ACTUATORS,
    HIL_GPS,
    HIL_SENSOR,
    NEIGHBOUR,
    RELAYED_AT,
    REPORT_AT,
    SIM_STATE,
    SIM_STEP,
)
from mavlink_defs.framing.header import CRC_SIZE, HEADER_SIZE, SIGNATURE_SIZE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.sensing.config import Sensor
from sitl_plant.sensing.units import UPDATED, Unit, units_of
from sitl_plant.vec3 import mul, vec3

KINDS = ("states", "actuator_messages", "neighbour_messages")
"""Messages whose bytes are counted."""


class Traffic:
    """The bytes of each UAV's messages, counted while a flight is flown.

    Attributes:
        bytes: Shape (n, 3): of the states that its aircraft sent to its autopilot, and of what the
            autopilot sent: actuator messages, and neighbour messages to all neighbours together.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self._triggered = scenario.links.formation.trigger is not None
        self._units: list[Unit] | None = None
        if scenario.navigation == "estimated":
            self._units = units_of(scenario.sensors.navigation, scenario.step_us)
        self._exact_air = scenario.sensors.airspeed_m_s == Sensor()
        self._frame = HEADER_SIZE + CRC_SIZE
        if scenario.links.signing_key is not None:
            self._frame += SIGNATURE_SIZE
        self._silent = np.zeros(SIM_STATE["silent"].shape, np.uint8)  # at the last step
        hear = (scenario.neighbours, scenario.listeners)
        self._degrees = [sum(len(one(i)) for one in hear) for i in self._ids]
        self.bytes = np.zeros((len(self._ids), len(KINDS)), np.int64)

    def add(self, steps: Steps) -> None:
        """Count the next steps."""
        silent = self._silent_before(steps)
        for i, degree in enumerate(self._degrees):
            self.bytes[i] += (
                self._state_bytes(steps, i, silent),
                self._bytes_of(self._actuator_messages(steps, i)),
                self._bytes_of(self._neighbour_messages(steps, i)) * degree,
            )

    def _bytes_of(self, messages: np.ndarray) -> int:
        """Return the size of all frames of payloads, shape (m,) [bytes]."""
        payloads = messages.view(np.uint8).reshape(len(messages), messages.dtype.itemsize)
        return payload_bytes(payloads) + self._frame * len(messages)

    def _silent_before(self, steps: Steps) -> np.ndarray:
        """Return FTC_SIM_STATE.silent of each step: who sent no message in the step before."""
        silent = np.zeros((steps.length + 1, len(self._silent)), np.uint8)
        silent[0] = self._silent
        for j, system in enumerate(self._ids):
            quiet = steps.signals["neighbour_message"][:, j] == 0
            silent[1:, system // 8] |= quiet.astype(np.uint8) << system % 8
        self._silent = silent[-1]
        return silent[:-1]

    def _state_bytes(self, steps: Steps, i: int, silent: np.ndarray) -> int:
        if self._units is not None:
            return self._sensor_bytes(steps, self._units, silent)
        wind = steps.wind[:, i]
        alike = not silent.any() and not (self._exact_air and wind.any())
        count = min(steps.length, 1) if alike else steps.length
        messages = np.zeros(count, SIM_STATE)
        messages["run"] = 2**31  # never 0 in its last byte
        messages["wind"] = wind[:count] if self._exact_air else 1.0
        messages["silent"] = silent[:count]
        return self._bytes_of(messages) * (steps.length if alike else 1)

    def _sensor_bytes(self, steps: Steps, units: Sequence[Unit], silent: np.ndarray) -> int:
        """Return the bytes of HIL_SENSOR, HIL_GPS and FTC_SIM_STEP, all sensors being well."""
        numbers = np.arange(steps.first, steps.first + steps.length)
        imus = 1 + max(unit.imu for unit in units)
        sensors = np.zeros((imus, steps.length), HIL_SENSOR)
        sensors["temperature"] = 1.0  # the last value, of a barometer or not
        sensors["id"] = np.arange(imus)[:, None]
        samples = 0
        for unit in units:
            measured = numbers - unit.late
            due = (measured >= 0) & (measured % unit.every == 0)
            if unit.kind == GNSS:
                samples = int(due.sum())
            else:
                sensors["fields_updated"][unit.imu, due] |= UPDATED[unit.kind]
        gps = np.ones(samples, HIL_GPS)
        gps["yaw"] = gps["id"] = 0
        step = np.zeros(steps.length, SIM_STEP)
        step["flags"], step["silent"] = FTC_SIM_FLAGS_RUNNING, silent
        return sum(map(self._bytes_of, (sensors.reshape(-1), gps, step)))

    def _actuator_messages(self, steps: Steps, i: int) -> np.ndarray:
        rows = np.flatnonzero(steps.signals["events"][:, i])
        messages = np.zeros(len(rows), ACTUATORS)
        messages["time_usec"] = (steps.first + rows) * self._scenario.step_us
        messages["controls"][:, :N_CHANNELS] = steps.signals["held"][rows, i]
        messages["mode"] = np.where(_active(steps, i, rows), MAV_MODE_FLAG_SAFETY_ARMED, 0)
        return messages

    def _neighbour_messages(self, steps: Steps, i: int) -> np.ndarray:
        rows = np.flatnonzero(steps.signals["neighbour_message"][:, i])
        messages = np.zeros(len(rows), NEIGHBOUR)
        messages["step"] = steps.first + rows
        signals = steps.signals[:, i]
        on_path = np.isfinite(signals["path_position"][rows])
        refers = on_path | (_active(steps, i, rows) & self._triggered)
        messages["frame"] = np.where(refers, FTC_NEIGHBOUR_FRAME_REFERENCE, 0)
        if self._scenario.formation is not None:
            attitudes, sizes = signals["attitude"][rows], signals["report_size"][rows]
            fill_places(messages, on_path, attitudes, steps.states[rows, i, 3:6], sizes)
        return messages


def _active(steps: Steps, i: int, rows: np.ndarray) -> np.ndarray:
    active: np.ndarray = np.isfinite(steps.signals["command"][rows, i, 0])
    return active


@compiled
def fill_places(
    messages: np.ndarray,
    on_path: np.ndarray,
    attitudes: np.ndarray,
    velocities: np.ndarray,
    report_sizes: np.ndarray,
) -> None:
    """Fill FTC_NEIGHBOUR payloads from the place on, as far as their length depends on it.

    Args:
        messages: Shape (m,), updated in place.
        on_path: Whether a path is flown, shape (m,).
        attitudes: Measured, shape (m, 3) [rad].
        velocities: Body axes, shape (m, 3) [m/s].
        report_sizes: Bytes from the report on without the zeros at the end, shape (m,).
    """
    for k in range(len(messages)):
        if not on_path[k]:
            continue
        message, size = messages[k], report_sizes[k]
        message["path_id"] = 1
        message["position"][2] = 1.0
        velocity = mul(R1(vec3(attitudes[k])), vec3(velocities[k]))
        for axis in range(3):
            message["ground_velocity"][axis] = velocity[axis]
        if size > RELAYED_AT - REPORT_AT:
            message["relayed"][size - 1 - (RELAYED_AT - REPORT_AT)] = 1
        elif size > 0:
            message["report"][size - 1] = 1


@compiled
def payload_bytes(payloads: np.ndarray) -> int:
    """Return the bytes of payloads, shape (m, size), without the zeros at their ends.

    One byte is sent in any case, https://mavlink.io/en/guide/serialization.html.
    """
    used = np.zeros(payloads.shape[1], np.uint8)
    for k in range(payloads.shape[0]):
        for at in range(payloads.shape[1]):  # many bytes at a time: most are 0 in all payloads
            used[at] |= payloads[k, at]
    longest = payloads.shape[1]
    while longest > 1 and used[longest - 1] == 0:
        longest -= 1
    total = 0
    for k in range(payloads.shape[0]):
        size = longest
        while size > 1 and payloads[k, size - 1] == 0:
            size -= 1
        total += size
    return total

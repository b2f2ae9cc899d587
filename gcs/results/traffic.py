"""Bytes on the links of a flight, computed from its recording.

MAVLink 2 does not send the zeros at the end of a payload. So each message is laid out here as far
as its length needs, and measured. Counted is what a flight without losses sends between its first
step and its last: states, actuator messages and neighbour messages, each once. What a link
repeats, and what is said before the start and with FTC_STEP_DONE, a tap counts beside it.
"""

import numpy as np

from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE, MAV_MODE_FLAG_SAFETY_ARMED
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR, SIM_STATE
from mavlink_defs.framing.header import CRC_SIZE, HEADER_SIZE, SIGNATURE_SIZE
from sitl_plant.hardware import Sensor

__all__ = ["KINDS", "bytes_by_link"]

KINDS = ("states", "actuator_messages", "neighbour_messages")
"""Messages whose bytes are counted."""


def bytes_by_link(recording: Recording, scenario: Scenario, i: int, degree: int) -> dict[str, int]:
    """Return the bytes of the i-th UAV's messages.

    Args:
        recording: The flight.
        scenario: What was flown.
        i: Index of the UAV.
        degree: Number of its neighbours.

    Returns:
        States that its aircraft sent to its autopilot, `states`; and what the autopilot sent:
        `actuator_messages`, and to all neighbours together `neighbour_messages`.
    """
    signed = scenario.links.signing_key is not None
    sizes = (
        _bytes_of(_states(recording, scenario, i), signed),
        _bytes_of(_actuator_messages(recording, i), signed),
        _bytes_of(_neighbour_messages(recording, scenario, i), signed) * degree,
    )
    return dict(zip(KINDS, sizes, strict=True))


def _bytes_of(messages: np.ndarray, signed: bool) -> int:
    """Return the size of all frames of payloads, shape (m,) [bytes]."""
    payloads = messages.view(np.uint8).reshape(len(messages), messages.dtype.itemsize)
    sent = np.maximum.accumulate(payloads[:, ::-1] != 0, axis=1)
    sizes = np.maximum(sent.sum(axis=1), 1)  # at least one byte, https://mavlink.io
    frame = HEADER_SIZE + CRC_SIZE + (SIGNATURE_SIZE if signed else 0)
    return int(sizes.sum()) + frame * len(messages)


def _states(recording: Recording, scenario: Scenario, i: int) -> np.ndarray:
    messages = np.zeros(len(recording.states), SIM_STATE)
    messages["run"] = 2**31  # never 0 in its last byte
    exact = scenario.sensors.airspeed_m_s == Sensor()
    messages["wind"] = recording.wind[:, i] if exact else 1.0
    if scenario.links.formation.trigger is not None:
        silent = recording.signals["neighbour_message"] == 0
        for j, system in enumerate(recording.uav_ids):
            messages["silent"][1:, system // 8] |= silent[:-1, j].astype(np.uint8) << system % 8
    return messages


def _actuator_messages(recording: Recording, i: int) -> np.ndarray:
    steps = np.flatnonzero(recording.signals["events"][:, i])
    messages = np.zeros(len(steps), ACTUATORS)
    messages["time_usec"] = steps * recording.step_us
    messages["controls"][:, :N_CHANNELS] = recording.signals["held"][steps, i]
    armed = recording.active[steps, i]
    messages["mode"] = np.where(armed, MAV_MODE_FLAG_SAFETY_ARMED, 0)
    return messages


def _neighbour_messages(recording: Recording, scenario: Scenario, i: int) -> np.ndarray:
    steps = np.flatnonzero(recording.signals["neighbour_message"][:, i])
    messages = np.zeros(len(steps), NEIGHBOUR)
    messages["step"] = steps
    if scenario.links.formation.trigger is not None:
        active = recording.active[steps, i]
        messages["frame"] = np.where(active, FTC_NEIGHBOUR_FRAME_REFERENCE, 0)
    return messages

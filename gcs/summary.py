"""Figures of one flight: events, savings, intervals, tracking errors."""

from typing import Any

import numpy as np

from ftc_autopilot.reference import wrap
from gcs.recording import Recording
from mavlink_defs.faults import ACTUATORS
from mavlink_defs.jit import compiled

__all__ = ["CHANNELS", "QUANTITIES", "event_table", "summarise"]

CHANNELS = ("throttle", "aileron", "elevator", "rudder")
"""Actuator channels in the order of the paper's tables."""
QUANTITIES = ("airspeed", "roll", "pitch", "yaw")
"""What is tracked: m/s and deg."""

_SETTLING_S = 1.0  # the largest error counts after this time
_FINAL_S = 1.0  # the final error is the largest one of this long before the end
_DEPARTED = np.pi / 2.0  # attitude error beyond which an aircraft has departed [rad]


def summarise(recording: Recording, scenario_name: str) -> dict[str, Any]:
    """Make the content of `summary.json`.

    Saving is the share of the periodic sender's transmissions that the triggers did without;
    a periodic sender transmits every channel in every control step.
    """
    steps = len(recording.states)
    uavs = [_summarise_uav(recording, i) for i in range(len(recording.uav_ids))]
    sent = sum(c["events"] for uav in uavs for c in uav["channels"].values())
    wall_s = recording.wall_s
    return {
        "scenario": scenario_name,
        "completed": recording.loss is None,
        "loss": recording.loss,
        "mode": recording.mode,
        "duration_s": recording.duration_s,
        "steps": steps,
        "wall_s": wall_s,
        "real_time_factor": recording.duration_s / wall_s if wall_s > 0.0 else None,
        "saving": _saving(sent, steps * len(CHANNELS) * len(uavs)),
        "uavs": uavs,
    }


def _summarise_uav(recording: Recording, i: int) -> dict[str, Any]:
    signals = recording.signals[:, i]
    channels: dict[str, Any] = {}
    for name in CHANNELS:
        c = ACTUATORS.index(name)
        at = np.flatnonzero(signals["events"] & (1 << c))
        gaps = np.diff(at)
        channels[name] = {
            "events": len(at),
            "repeats": int(recording.repeats[i, c]),
            "min_interval_s": int(gaps.min()) * recording.step_us / 1e6 if len(gaps) else None,
        }
    steps = len(signals)
    sent = sum(c["events"] for c in channels.values())
    actual = np.column_stack([signals["V"], signals["attitude"]])
    return {
        "id": recording.uav_ids[i],
        "saving": _saving(sent, steps * len(CHANNELS)),
        "channels": channels,
        "actuator_messages": int(np.count_nonzero(signals["events"])),
        "iae": _by_quantity(_integral(recording, _error(actual, signals["command"]))),
        "iae_filtered": _by_quantity(_integral(recording, signals["error"])),
        "max_error": _by_quantity(_largest(recording.time_s > _SETTLING_S, signals["error"])),
        "final_error": _by_quantity(
            _largest(recording.time_s >= recording.duration_s - _FINAL_S, signals["error"])
        ),
        "departed_at_s": _departure(recording, i),
    }


def event_table(recording: Recording) -> dict[str, np.ndarray]:
    """Every event of the flight as columns of equal length, ordered by time.

    Columns: `uav` (system id), `channel` (number as in `mavlink_defs.faults.ACTUATORS`),
    `step`, `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    events = recording.signals["events"]
    bits = np.stack([events >> c & 1 for c in range(len(ACTUATORS))], axis=-1)
    step, uav, channel = np.nonzero(bits)
    return {
        "uav": np.array(recording.uav_ids)[uav],
        "channel": channel,
        "step": step,
        "time_s": step * recording.step_us / 1e6,
        "value": recording.signals["held"][step, uav, channel],
    }


def _saving(sent: int, periodic: int) -> float | None:
    return 1.0 - sent / periodic if periodic else None


def _error(actual: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    error: np.ndarray = actual - wanted
    _wrap_all(error[:, 1])
    _wrap_all(error[:, 3])
    return error


@compiled
def _wrap_all(angles: np.ndarray) -> None:
    for k in range(len(angles)):
        angles[k] = wrap(angles[k])


def _integral(recording: Recording, error: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(error).sum(axis=0) * recording.step_us / 1e6)


def _largest(when: np.ndarray, error: np.ndarray) -> np.ndarray:
    counted = np.abs(error[when])
    return np.asarray(counted.max(axis=0)) if len(counted) else np.full(len(QUANTITIES), np.nan)


def _departure(recording: Recording, i: int) -> float | None:
    """When roll, pitch or yaw first was more than 90° off [s]; None if never."""
    attitude_error = np.abs(recording.signals["error"][:, i, 1:])
    beyond = np.flatnonzero((attitude_error > _DEPARTED).any(axis=1))
    return float(recording.time_s[beyond[0]]) if len(beyond) else None


def _by_quantity(values: np.ndarray) -> dict[str, float | None]:
    """Name four values; angles from rad to deg; a value that does not exist becomes None."""
    shown = [values[0], *np.degrees(values[1:])]
    return {
        name: float(value) if np.isfinite(value) else None
        for name, value in zip(QUANTITIES, shown, strict=True)
    }

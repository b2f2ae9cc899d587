"""Figures of one flight: events, savings, intervals, tracking errors."""

from typing import Any

import numpy as np

from ftc_autopilot.reference import wrap
from gcs.recording import Recording
from mavlink_defs.faults import ACTUATORS

__all__ = ["CHANNELS", "QUANTITIES", "event_table", "summarise"]

CHANNELS = ("throttle", "aileron", "elevator", "rudder")
"""Actuator channels in the order of the paper's tables."""
QUANTITIES = ("airspeed", "roll", "pitch", "yaw")
"""What is tracked: m/s and deg."""

_SETTLING_S = 1.0  # the largest error counts after this time


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
        "max_error": _by_quantity(_largest(recording, signals["error"])),
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
    error[:, 3] = [wrap(angle) for angle in error[:, 3]]
    return error


def _integral(recording: Recording, error: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(error).sum(axis=0) * recording.step_us / 1e6)


def _largest(recording: Recording, error: np.ndarray) -> np.ndarray:
    settled = np.abs(error[recording.time_s > _SETTLING_S])
    return np.asarray(settled.max(axis=0)) if len(settled) else np.full(len(QUANTITIES), np.nan)


def _by_quantity(values: np.ndarray) -> dict[str, float | None]:
    """Name four values; angles from rad to deg; a value that does not exist becomes None."""
    shown = [values[0], *np.degrees(values[1:])]
    return {
        name: float(value) if np.isfinite(value) else None
        for name, value in zip(QUANTITIES, shown, strict=True)
    }

"""Figures of one flight: events, savings, intervals, tracking errors."""

from typing import Any

import numpy as np

from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS

__all__ = ["PAPER_ORDER", "QUANTITIES", "event_table", "summarise"]

PAPER_ORDER = ("throttle", "aileron", "elevator", "rudder")
"""Actuator channels in the order of the paper's tables."""
QUANTITIES = ("airspeed", "roll", "pitch", "yaw")
"""What is tracked: m/s and deg."""

_SETTLING_S = 1.0  # the largest error counts after this time
_FINAL_S = 1.0  # the final error is the largest one of this long before the end
_ASTRAY = np.pi / 2.0  # error of an angle beyond which attitude or heading is lost [rad]


def summarise(recording: Recording, scenario: Scenario) -> dict[str, Any]:
    """Make the content of `summary.json`.

    Saving is the share of the periodic sender's transmissions that the triggers did without;
    a periodic sender transmits every channel in every step that the law is evaluated at.
    Errors are those of the true state, as `Recording.error` gives them.
    """
    steps = len(recording.states)
    commands, reference = recording.error("command"), recording.error("reference")
    uavs = [
        _summarise_uav(recording, i, commands[:, i], reference[:, i])
        for i in range(len(recording.uav_ids))
    ]
    sent = sum(c["events"] for uav in uavs for c in uav["channels"].values())
    wall_s = recording.wall_s
    loss = recording.loss
    if loss is None and steps < scenario.steps:
        loss = f"stopped at {recording.duration_s:g} s of {scenario.duration_s:g} s"
    return {
        "scenario": scenario.name,
        "completed": loss is None,
        "loss": loss,
        "mode": recording.mode,
        "duration_s": recording.duration_s,
        "steps": steps,
        "wall_s": wall_s,
        "real_time_factor": recording.duration_s / wall_s if wall_s > 0.0 else None,
        "saving": _saving(sent, sum(uav["active_steps"] for uav in uavs) * len(PAPER_ORDER)),
        "uavs": uavs,
    }


def _summarise_uav(
    recording: Recording, i: int, commands: np.ndarray, reference: np.ndarray
) -> dict[str, Any]:
    """Summarise the i-th UAV, given its errors against commands and reference, (steps, 4)."""
    signals = recording.signals[:, i]
    active = int(np.count_nonzero(recording.active[:, i]))
    time_s = recording.time_s
    channels: dict[str, Any] = {}
    for name in PAPER_ORDER:
        c = ACTUATORS.index(name)
        at = np.flatnonzero(signals["events"] & (1 << c))
        gaps = np.diff(at)
        channels[name] = {
            "events": len(at),
            "repeats": int(recording.repeats[i, c]),
            "min_interval_s": int(gaps.min()) * recording.step_us / 1e6 if len(gaps) else None,
        }
    sent = sum(c["events"] for c in channels.values())
    return {
        "id": recording.uav_ids[i],
        "active_steps": active,
        "missing_steps": int(np.count_nonzero(recording.missing[:, i])),
        "saving": _saving(sent, active * len(PAPER_ORDER)),
        "channels": channels,
        "actuator_messages": int(np.count_nonzero(signals["events"])),
        "iae": _by_quantity(_integral(recording, commands)),
        "iae_filtered": _by_quantity(_integral(recording, reference)),
        "max_error": _by_quantity(_largest(reference[time_s > _SETTLING_S])),
        "final_error": _by_quantity(_largest(reference[time_s >= recording.duration_s - _FINAL_S])),
        "attitude_lost_at_s": _astray_at_s(time_s, reference[:, 1:3]),
        "heading_lost_at_s": _astray_at_s(time_s, reference[:, 3:]),
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


def _integral(recording: Recording, error: np.ndarray) -> np.ndarray:
    """Integral of the absolute error over the steps that have one; NaN if none has."""
    counted = np.abs(_defined(error))
    total = counted.sum(axis=0) * recording.step_us / 1e6
    return np.asarray(total) if len(counted) else np.full(len(QUANTITIES), np.nan)


def _largest(error: np.ndarray) -> np.ndarray:
    """Largest absolute error of the steps that have one; NaN if none has."""
    counted = np.abs(_defined(error))
    return np.asarray(counted.max(axis=0)) if len(counted) else np.full(len(QUANTITIES), np.nan)


def _defined(error: np.ndarray) -> np.ndarray:
    """Without the steps at which the UAV was disarmed: nothing was wanted of it."""
    defined: np.ndarray = error[np.isfinite(error).all(axis=1)]
    return defined


def _astray_at_s(time_s: np.ndarray, angles: np.ndarray) -> float | None:
    """When one of some angles' errors, shape (steps, k), first was beyond 90° [s], or None."""
    beyond = np.flatnonzero((np.abs(angles) > _ASTRAY).any(axis=1))
    return float(time_s[beyond[0]]) if len(beyond) else None


def _by_quantity(values: np.ndarray) -> dict[str, float | None]:
    """Name four values; angles from rad to deg; a value that does not exist becomes None."""
    shown = [values[0], *np.degrees(values[1:])]
    return {
        name: float(value) if np.isfinite(value) else None
        for name, value in zip(QUANTITIES, shown, strict=True)
    }

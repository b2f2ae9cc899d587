"""A flight's data as files for other tools: NumPy's .npz at full rate, and CSV."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gcs.results.quantities import TRACKED_KEYS, in_degrees
from gcs.results.recording import Recording
from gcs.results.summary import event_table
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.runtime.files import naming

CSV_PERIOD_S = 0.01
"""Rows of trajectory.csv are this far apart [s]; events.csv and the .npz have every step."""

_SIGNALS = (
    "command",
    "reference",
    "error",
    "sync_error",
    "demand",
    "held",
    "events",
    "neighbour_message",
    "Phi_v",
    "g_v",
    "beta_v",
    "Phi_omega",
    "beta_omega",
)
_ACTUATED = (*(f"{surface}_deg" for surface in ACTUATORS[:3]), "thrust_n")


def export_flight(recording: Recording, folder: Path) -> None:
    """Write `trajectory.npz`, `trajectory.csv`, `events.npz` and `events.csv`.

    The trajectory has states, references, errors, commands and estimates; the inner quantities
    of the law follow from these, and are in the run folder of `gcs fly`.

    Args:
        recording: The flight.
        folder: Exists already.

    Raises:
        OSError: One of them cannot be written; it is named.
    """
    events = event_table(recording)
    with naming(folder / "events.npz"):
        np.savez_compressed(folder / "events.npz", **events)  # type: ignore[arg-type]  # no allow_pickle
    _write_events(folder / "events.csv", events)
    arrays = {name: recording.signals[name] for name in _SIGNALS}
    with naming(folder / "trajectory.npz"):
        np.savez_compressed(
            folder / "trajectory.npz",
            uav=np.array(recording.uav_ids),
            time_s=recording.time_s,
            state=recording.states,
            wind=recording.wind,
            applied=recording.applied,
            **arrays,  # type: ignore[arg-type]  # no allow_pickle
        )
    _write_trajectory(folder / "trajectory.csv", recording)


def _write_events(path: Path, events: dict[str, np.ndarray]) -> None:
    """Write the events as CSV, with names and degrees."""
    surface = events["channel"] < 3
    value = np.where(surface, np.degrees(events["value"]), events["value"])
    with naming(path), path.open("w") as file:
        file.write("time_s,uav,channel,value_deg_or_n\n")
        rows = zip(events["time_s"], events["uav"], events["channel"], value, strict=True)
        file.writelines(f"{t:.6g},{uav},{ACTUATORS[c]},{v:.6g}\n" for t, uav, c, v in rows)


def _write_trajectory(path: Path, recording: Recording) -> None:
    every = max(round(CSV_PERIOD_S * 1e6 / recording.step_us), 1)
    states, signals = recording.states[::every], recording.signals[::every]
    applied = recording.applied[::every]
    columns: dict[str, np.ndarray] = {
        "time_s": np.broadcast_to(recording.time_s[::every, None], states.shape[:2]),
        "uav": np.broadcast_to(np.array(recording.uav_ids), states.shape[:2]),
        "north_m": states[..., 0],
        "east_m": states[..., 1],
        "altitude_m": -states[..., 2],
    }
    columns |= {f"{axis}_m_s": states[..., 3 + i] for i, axis in enumerate("uvw")}
    columns |= {f"{axis}_deg_s": np.degrees(states[..., 9 + i]) for i, axis in enumerate("pqr")}
    columns |= _tracked(TRACKED_KEYS, recording.response[::every])
    for name in ("command", "reference", "error", "sync_error"):
        columns |= _tracked([f"{name}_{key}" for key in TRACKED_KEYS], signals[name])
    columns |= _actuated("demand", signals["demand"])
    columns |= _actuated("held", signals["held"])
    columns |= _actuated("applied", applied)
    table = np.column_stack([values.ravel() for values in columns.values()])
    with naming(path):
        np.savetxt(path, table, fmt="%.7g", delimiter=",", header=",".join(columns), comments="")


def _tracked(names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Name airspeed [m/s] and three angles [rad to deg]."""
    return dict(zip(names, np.moveaxis(in_degrees(values), -1, 0), strict=True))


def _actuated(prefix: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Name three deflections [rad to deg] and the thrust [N]."""
    columns = [*np.moveaxis(np.degrees(values[..., :3]), -1, 0), values[..., 3]]
    return {f"{prefix}_{name}": column for name, column in zip(_ACTUATED, columns, strict=True)}

"""The picture of one flight: tracking, held commands, intervals between events."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcs.recording import Recording
from gcs.scenario import Scenario
from gcs.summary import CHANNELS, QUANTITIES
from mavlink_defs.faults import ACTUATORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["COLOURS", "draw_flight"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's palette: told apart with any colour vision, and in print."""

_UNITS = {"airspeed": "m/s", "roll": "deg", "pitch": "deg", "yaw": "deg"}


def draw_flight(recording: Recording, scenario: Scenario, path: Path) -> None:
    """Draw a flight into an image file (its suffix tells the format).

    Rows: airspeed and attitude of all UAVs against the filtered reference (dashed); held
    actuator commands; intervals between two events of a channel. Fault windows are shaded.
    """
    import matplotlib as mpl  # noqa: PLC0415 - takes a second, and only this function needs it

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    names = {uav.id: uav.name for uav in scenario.uavs}
    figure, axes = plt.subplots(3, 4, figsize=(16, 9), sharex=True, layout="constrained")
    for column, quantity in enumerate(QUANTITIES):
        _draw_quantity(axes[0, column], recording, names, column, quantity)
    for column, channel in enumerate(CHANNELS):
        _draw_command(axes[1, column], recording, channel)
        _draw_intervals(axes[2, column], recording, channel)
    for axis in axes.flat:
        _shade_faults(axis, scenario, recording.duration_s)
        axis.grid(alpha=0.3)
        axis.margins(x=0.0)
    for axis in axes[2]:
        axis.set_xlabel("simulation time [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_quantity(
    axis: "Axes", recording: Recording, names: dict[int, str], column: int, quantity: str
) -> None:
    t, signals = recording.time_s, recording.signals
    for i, uav_id in enumerate(recording.uav_ids):
        actual = signals["V"][:, i] if column == 0 else signals["attitude"][:, i, column - 1]
        label = f"UAV {uav_id} ({names[uav_id]})"
        width = max(3.0 - i, 1.0)  # lines that coincide stay visible below each other
        axis.plot(t, _shown(actual, column), color=_colour(i), lw=width, label=label)
    reference = _shown(signals["reference"][:, 0, column], column)
    axis.plot(t, reference, "k--", lw=1.0, label="reference")
    axis.set_title(quantity)
    axis.set_ylabel(f"{quantity} [{_UNITS[quantity]}]")


def _draw_command(axis: "Axes", recording: Recording, channel: str) -> None:
    c = ACTUATORS.index(channel)
    for i in range(len(recording.uav_ids)):
        held = recording.signals["held"][:, i, c]
        shown = held if channel == "throttle" else np.degrees(held)
        axis.step(recording.time_s, shown, where="post", color=_colour(i), lw=0.7, alpha=0.8)
    axis.set_title(f"{channel}, as held")
    axis.set_ylabel("thrust [N]" if channel == "throttle" else f"{channel} [deg]")


def _draw_intervals(axis: "Axes", recording: Recording, channel: str) -> None:
    c = ACTUATORS.index(channel)
    for i in range(len(recording.uav_ids)):
        at = np.flatnonzero(recording.signals["events"][:, i] & (1 << c))
        seconds = at * recording.step_us / 1e6
        axis.plot(seconds[1:], 1e3 * np.diff(seconds), ".", ms=2, color=_colour(i), alpha=0.6)
    axis.set_yscale("log")
    axis.set_title(f"{channel}: time since the event before")
    axis.set_ylabel("interval [ms]")


def _shade_faults(axis: "Axes", scenario: Scenario, duration_s: float) -> None:
    for fault in scenario.faults:
        end = duration_s if fault.end_s is None else min(fault.end_s, duration_s)
        label = f"fault: {fault.actuator} of UAV {fault.uav}"
        axis.axvspan(fault.start_s, end, color="0.85", zorder=0, lw=0, label=label)


def _shown(values: np.ndarray, column: int) -> np.ndarray:
    if column == 0:
        return values
    return np.degrees((values + np.pi) % (2.0 * np.pi) - np.pi)


def _colour(i: int) -> str:
    return COLOURS[i % len(COLOURS)]

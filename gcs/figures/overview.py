"""One flight at a glance: tracking, held commands, intervals between events."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from gcs.figures.flown import PlottedFlight
from gcs.figures.style import (
    draw_curve,
    draw_legend,
    mark_loss,
    new_figure,
    shade_faults,
    style,
    tidy,
)
from gcs.figures.tracking import draw_tracking
from gcs.results.quantities import PAPER_ORDER
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.runtime.files import naming

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_command", "draw_flight"]

Gaps: TypeAlias = Mapping[tuple[int, int], np.ndarray]


def draw_flight(recording: Recording, scenario: Scenario, gaps: Gaps, path: Path) -> None:
    """Draw a flight into an image file (its suffix tells the format).

    Rows: airspeed and attitude of all UAVs against the filtered reference (dashed); held
    actuator commands; intervals between two events of a channel. Fault windows are shaded.

    Args:
        recording: The flight, as of `gcs.results.preview.Preview`.
        scenario: What was flown.
        gaps: Intervals between events, as there.
        path: The file.
    """
    flight = PlottedFlight(scenario.name, scenario, recording)
    figure = new_figure(6.6)
    axes = figure.subplots(3, 4, sharex=True)
    draw_tracking(axes[0], flight)
    for column, channel in enumerate(PAPER_ORDER):
        draw_command(axes[1, column], flight, channel)
        _draw_intervals(axes[2, column], flight, gaps, channel)
    for axis in axes.flat:
        shade_faults(axis, [flight])
        mark_loss(axis, flight)
        tidy(axis, scenario.duration_s)
    for axis in axes[2]:
        axis.set_xlabel("time [s]")
    draw_legend(figure)
    with naming(path):
        figure.savefig(path, dpi=150)


def draw_command(axis: "Axes", flight: PlottedFlight, channel: str) -> None:
    """Draw the held commands of a channel of all UAVs over time."""
    c = ACTUATORS.index(channel)
    for i in range(len(flight.names)):
        held = flight.recording.signals["held"][:, i, c]
        shown = held if channel == "throttle" else np.degrees(held)
        line = style(i).line | {"lw": 0.7, "alpha": 0.8}
        draw_curve(axis, flight.recording.time_s, shown, drawstyle="steps-post", **line)
    axis.set_ylabel("thrust [N]" if channel == "throttle" else f"{channel} [deg]")


def _draw_intervals(axis: "Axes", flight: PlottedFlight, gaps: Gaps, channel: str) -> None:
    for i, system in enumerate(flight.recording.uav_ids):
        times, intervals = gaps[system, ACTUATORS.index(channel)]
        axis.plot(
            times,
            1e3 * intervals,
            ".",
            ms=2.2,
            mew=0,
            color=style(i).colour,
            alpha=0.6,
            rasterized=True,
        )
    axis.set_yscale("log")
    axis.minorticks_off()
    axis.set_ylabel(f"{channel} interval [ms]")

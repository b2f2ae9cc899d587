"""One flight at a glance: tracking, held commands, intervals between events."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from gcs.reports.figures import style
from gcs.reports.figures.flown import PlottedFlight
from gcs.reports.figures.tracking import draw_tracking
from gcs.results.quantities import PAPER_ORDER
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Gaps: TypeAlias = Mapping[tuple[int, int], np.ndarray]


def draw_flight(recording: Recording, scenario: Scenario, gaps: Gaps, folder: Path) -> None:
    """Draw a flight as `flight.png` and `flight.svg`; arguments as of `overview`."""
    style.save(overview(recording, scenario, gaps), folder, "flight")


def overview(recording: Recording, scenario: Scenario, gaps: Gaps) -> "Figure":
    """Draw a flight at a glance.

    Rows: airspeed and attitude of all UAVs against the filtered reference (dashed); held
    actuator commands; intervals between two events of a channel. Fault windows are shaded.

    Args:
        recording: The flight, as of `gcs.results.preview.Preview`.
        scenario: What was flown.
        gaps: Intervals between events, as there.
    """
    flight = PlottedFlight(scenario.name, scenario, recording)
    figure = style.new_figure(7.4, layout=None)
    axes = figure.subplots(3, 4, sharex=True)
    draw_tracking(axes[0], flight)
    for column, channel in enumerate(PAPER_ORDER):
        draw_command(axes[1, column], flight, channel)
        _draw_intervals(axes[2, column], flight, gaps, channel)
    for axis in axes.flat:
        style.shade_faults(axis, [flight])
        style.mark_loss(axis, flight)
        style.tidy(axis, scenario.duration_s)
    figure.align_ylabels()
    style.fit_margins(figure, style.draw_legend(figure))
    return figure


def draw_command(axis: "Axes", flight: PlottedFlight, channel: str) -> None:
    """Draw the held commands of a channel of all UAVs over time; note what its axis leaves out."""
    held = flight.recording.signals["held"][:, :, ACTUATORS.index(channel)].T
    curves = list(held if channel == "throttle" else np.degrees(held))
    for i, curve in enumerate(curves):
        style.draw_curve(
            axis, flight.recording.time_s, curve, drawstyle="steps-post", **style.style(i).thin
        )
    style.frame(axis, curves, *style.usual_range(curves, flight.step_s))
    axis.set_ylabel("thrust [N]" if channel == "throttle" else f"{channel} [deg]")


def _draw_intervals(axis: "Axes", flight: PlottedFlight, gaps: Gaps, channel: str) -> None:
    for i, system in enumerate(flight.recording.uav_ids):
        times, intervals = gaps[system, ACTUATORS.index(channel)]
        dot: dict[str, Any] = {
            "ms": 1.6 + 0.6 * style.style(i).width,
            "mew": 0,
            "color": style.style(i).colour,
        }
        axis.plot(times, 1e3 * intervals, ".", rasterized=True, **dot)
    style.logarithmic_intervals(axis)
    axis.set_ylabel(f"{channel} interval [ms]")

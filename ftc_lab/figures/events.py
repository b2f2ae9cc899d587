"""Figures 7, 8 and 9: when the triggers fired, and how often."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gcs.reports.figures import style
from gcs.reports.figures.flown import PlottedFlight
from gcs.results.quantities import PAPER_ORDER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BINS = 1200  # of time; as narrow as print shows
_RAMP = ("#74B4DE", "#0072B2", "#00273D")  # for few to many events
_TICKS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


def fig7(flight: PlottedFlight) -> "Figure":
    """Draw the time between two events of a channel: channels in rows, UAVs in columns."""
    names, ids = flight.names, flight.recording.uav_ids
    figure = style.new_figure(8.6)
    axes = figure.subplots(len(PAPER_ORDER), len(names), sharex=True, sharey=True, squeeze=False)
    for k, axis in enumerate(axes.flat):
        row, i = divmod(k, len(names))
        times = flight.event_times(i, PAPER_ORDER[row])
        intervals = 1e3 * np.diff(times)
        # thousands of dots: as an image in an SVG
        axis.plot(
            times[1:], intervals, ".", ms=2.8, mew=0, color=style.SINGLE, alpha=0.6, rasterized=True
        )
        style.logarithmic_intervals(axis)
        median = f", median {np.median(intervals):.3g} ms" if len(intervals) else ""
        style.note(axis, f"{len(times)} events{median}")
        style.letter(axis, k)
        style.shade_faults(axis, [flight], ids[i])
        style.mark_loss(axis, flight)
        style.tidy(axis, flight.scenario.duration_s)
    for axis, name in zip(axes[0], names, strict=True):
        axis.annotate(name, (0.5, 1.0), (0.0, 20.0), "axes fraction", "offset points", ha="center")
    for row, channel in zip(axes, PAPER_ORDER, strict=True):
        for axis in row:
            axis.set_ylabel(f"{channel}\ninterval [ms]")
    style.draw_legend(figure)
    return figure


def fig8(flight: PlottedFlight) -> "Figure":
    """Draw the event times of each channel of each UAV; darker where events are denser."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    names, ids = flight.names, flight.recording.uav_ids
    duration_s = flight.scenario.duration_s
    figure = style.new_figure(0.7 + 1.7 * len(names))
    axes = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    rows = range(len(PAPER_ORDER))
    bin_s = max(duration_s / _BINS, flight.step_s)
    bins = np.arange(0.0, duration_s + bin_s, bin_s) - 0.5 * flight.step_s
    most = max(bin_s / flight.step_s, 2.0)
    darkness = {"norm": LogNorm(1.0, most), "cmap": LinearSegmentedColormap.from_list("", _RAMP)}
    for i, axis in enumerate(axes):
        for row, channel in enumerate(PAPER_ORDER):
            counts = np.histogram(flight.event_times(i, channel), bins)[0]
            shown = np.ma.masked_equal(counts[np.newaxis], 0)
            image = axis.imshow(
                shown,
                extent=(bins[0], bins[-1], row + 0.36, row - 0.36),
                aspect="auto",
                interpolation="nearest",
                zorder=2.0,
                **darkness,
            )
        axis.set_ylim(len(PAPER_ORDER) - 0.4, -0.6)
        axis.set_yticks(rows, PAPER_ORDER)
        axis.set_ylabel(names[i])
        style.letter(axis, i)
        style.shade_faults(axis, [flight], ids[i])
        style.mark_loss(axis, flight)
        style.tidy(axis, duration_s)
        axis.grid(visible=False, axis="y")
        totals = axis.secondary_yaxis("right")
        totals.set_yticks(rows, map(str, flight.event_counts(i)))
        totals.tick_params(length=0, labelsize=style.SMALL, labelcolor=style.GREY)
        totals.spines["right"].set_visible(False)
    bar = figure.colorbar(image, ax=axes, aspect=40, pad=0.01)
    bar.set_label(f"events in {1e3 * bin_s:.3g} ms", size=style.SMALL + 1.0)
    bar.ax.minorticks_off()
    ticks = [k for k in _TICKS if k <= most]
    bar.set_ticks(ticks, labels=list(map(str, ticks)), size=style.SMALL)
    style.draw_legend(figure)
    return figure


def fig9(flight: PlottedFlight, printed: Mapping[int, Mapping[str, int]]) -> "Figure":
    """Draw the event counts of each channel of each UAV beside those printed in the paper.

    Args:
        flight: The flight.
        printed: The paper's event counts by UAV id and channel; some may be missing.
    """
    figure = style.new_figure(3.8)
    axes = figure.subplots(1, len(flight.names), sharey=True, squeeze=False)[0]
    places = np.arange(len(PAPER_ORDER))
    for i, (axis, name) in enumerate(zip(axes, flight.names, strict=True)):
        ours = flight.event_counts(i)
        paper = printed.get(flight.recording.uav_ids[i], {})
        bars = axis.bar(places - 0.21, ours, 0.4, color=style.SINGLE, label=flight.title)
        axis.bar_label(bars, size=style.SMALL, padding=1.0)
        known = [k for k, channel in enumerate(PAPER_ORDER) if channel in paper]
        if known:
            bars = axis.bar(
                places[known] + 0.21,
                [paper[PAPER_ORDER[k]] for k in known],
                0.4,
                color="white",
                edgecolor=style.STYLES[1].colour,
                hatch="////",
                label="printed in the paper",
            )
            axis.bar_label(bars, size=style.SMALL, padding=1.0)
        style.tidy(axis)
        axis.margins(y=0.1)
        axis.grid(visible=False, axis="x")
        axis.set_xticks(places, PAPER_ORDER)
        axis.tick_params(axis="x", length=0)
        axis.set_xlabel(name)
        axis.set_ylabel(f"events in {flight.scenario.duration_s:g} s")
    style.draw_legend(figure)
    return figure

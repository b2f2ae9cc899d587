"""The curves of the plots, drawn with plotext, without a widget or an app."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from textual.color import Color

from gcs.station.vehicle_state import VehicleState
from mavlink_defs.faults.fault import Fault

Colour: TypeAlias = tuple[int, int, int]

_ARROWS = "↑↗→↘↓↙←↖"
_FRAME_LINES = 3  # of a plot: upper and lower edge, and the time
_MEASURED = ("actual", "reference", "held", "predicted_exit", "position")

DRAWABLE = 1e8
"""Largest magnitude that is drawn, whatever its unit: larger ones are no measurements."""


@dataclass(frozen=True)
class Palette:
    """Colours of a theme.

    Attributes:
        actual: Measured values, and the selected vehicle.
        reference: What they should be, and other vehicles.
        fault: Begin and end of faults.
        channels: One per actuator.
        text: Labels.
        route: The mission on the map.
    """

    actual: Colour
    reference: Colour
    fault: Colour
    channels: tuple[Colour, Colour, Colour, Colour]
    text: Colour
    route: Colour


def palette_of(variables: Mapping[str, str]) -> Palette:
    """The colours of a theme, from its variables."""

    def rgb(name: str) -> Colour:
        return Color.parse(variables[name]).rgb

    channels = (rgb("primary"), rgb("accent"), rgb("success"), rgb("error"))
    return Palette(
        rgb("primary"), rgb("accent"), rgb("error"), channels, rgb("foreground"), rgb("success")
    )


def latest(state: VehicleState, span_s: float, until_s: float | None, points: int) -> np.ndarray:
    """Rows of a vehicle's history, thinned out to about `points`; NaN for what cannot be drawn.

    Args:
        state: The vehicle.
        span_s: How far back [s of simulated time].
        until_s: The end; None for the newest row.
        points: How many can be distinguished.
    """
    if until_s is None:
        rows = state.history.rows(span_s)
    else:
        rows = state.history.rows()
        time_s = rows["time_s"]
        rows = rows[(time_s <= until_s) & (time_s >= until_s - span_s)]
    rows = rows[rows["time_s"] > 0.0]  # before that nothing is flown, and the reference is 0
    rows = rows[:: max(1, len(rows) // max(points, 1))]
    for name in _MEASURED:
        rows[name][~(np.abs(rows[name]) <= DRAWABLE)] = np.nan
    return rows


def draw_quantity(
    plt: Any, rows: np.ndarray, i: int, limits: tuple[float, float], palette: Palette
) -> None:
    """Draw airspeed, roll, pitch or yaw (`i` from 0) against its reference."""
    time_s = rows["time_s"].tolist()
    reference, actual = rows["reference"][:, i], rows["actual"][:, i]
    _line(plt, time_s, reference.tolist(), palette.reference)
    _line(plt, time_s, actual.tolist(), palette.actual)
    low, high = _range(np.concatenate([reference, actual]), 0.5)
    plt.ylim(low, high)
    plt.yticks(ticks(low, high))
    _finish(plt, limits)


def draw_held(
    plt: Any,
    rows: np.ndarray,
    faults: Sequence[Fault],
    limits: tuple[float, float],
    height: int,
    palette: Palette,
) -> None:
    """Draw the commands held, a line of event marks per channel, and where faults begin and end.

    Args:
        plt: Where to.
        rows: Of a vehicle's history.
        faults: Of the vehicle.
        limits: Begin and end of the time shown [s].
        height: Of the plot in characters.
        palette: Colours.
    """
    time_s = rows["time_s"]
    low, high = _range(rows["held"], 0.02)
    lane = (high - low) / max(height - _FRAME_LINES - len(palette.channels) - 1, 2)
    new = np.diff(rows["events"], axis=0, prepend=rows["events"][:1]) > 0
    for fault in faults:
        for at in (fault.start_s, fault.end_s):
            if limits[0] < at < limits[1]:
                plt.vline(at, palette.fault)
    for k, colour in enumerate(palette.channels):
        _line(plt, time_s.tolist(), rows["held"][:, k].tolist(), colour)
        marks = time_s[new[:, k]].tolist()
        if marks:
            plt.scatter(marks, [low - (k + 1) * lane] * len(marks), marker="╵", color=colour)
    plt.ylim(low - (len(palette.channels) + 0.2) * lane, high)
    plt.yticks(ticks(low, high))
    _finish(plt, limits)


def draw_exits(plt: Any, rows: np.ndarray, limits: tuple[float, float], palette: Palette) -> None:
    """Draw for every channel the time until its output is predicted to leave its tube [s]."""
    exits = rows["predicted_exit"]
    for k, colour in enumerate(palette.channels):
        _line(plt, rows["time_s"].tolist(), exits[:, k].tolist(), colour)
    high = float(np.nanmax(exits)) if np.isfinite(exits).any() else 0.0
    plt.ylim(0.0, max(high, 0.1))
    plt.yticks(ticks(0.0, max(high, 0.1)))
    _finish(plt, limits)


def arrow(state: VehicleState) -> str:
    """Return an arrow to where a vehicle's nose points."""
    return arrow_to((state.attitude_deg or (0.0, 0.0, 0.0))[2])


def arrow_to(direction_deg: float) -> str:
    """Return an arrow to a direction, from north by east [deg]; a dot if it is not finite."""
    if not math.isfinite(direction_deg):
        return "·"
    return _ARROWS[round(direction_deg / 45.0) % 8]


def _line(plt: Any, x: list[float], y: list[float], colour: Colour) -> None:
    points = [(a, b) for a, b in zip(x, y, strict=True) if math.isfinite(b)]
    if points:
        xs, ys = zip(*points, strict=True)
        plt.plot(list(xs), list(ys), marker="braille", color=colour)


def _range(values: np.ndarray, least: float) -> tuple[float, float]:
    """A range that holds all values and is at least 2 * `least` wide."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    middle, half = (low + high) / 2.0, max((high - low) / 2.0 * 1.08, least)
    return middle - half, middle + half


def _finish(plt: Any, limits: tuple[float, float]) -> None:
    plt.xlim(*limits)
    plt.xticks(ticks(*limits))
    plt.grid(False, False)


def ticks(low: float, high: float) -> list[float]:
    """About five round numbers in a range."""
    rough = max(high - low, 1e-9) / 5.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough)
    first = math.ceil(low / step)
    return [round(k * step, 9) for k in range(first, math.floor(high / step) + 1)]

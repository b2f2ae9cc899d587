"""Figures 6, 10 and 11: responses and errors of airspeed and attitude."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gcs.reports.figures import style
from gcs.reports.figures.flown import PlottedFlight, fault_windows
from gcs.results.quantities import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {"airspeed": "m/s", "roll": "deg", "pitch": "deg", "yaw": "deg"}
"""Of `gcs.results.summary.QUANTITIES`."""

_SETTLING_S = 1.0  # panels of errors are for what follows; what was before may leave them
_BEYOND = 10.0  # m/s or deg of a response outside the reference's range that a panel shows
_ASTRAY = 5.0  # m/s or deg of an error that a panel shows
_AROUND_S = 1.0  # shown before and after a fault


@dataclass(frozen=True)
class _Curves:
    """Curves of all four quantities: times [s], shape (steps,), and values, shape (steps, 4)."""

    name: str
    t: np.ndarray
    values: np.ndarray

    @property
    def step_s(self) -> float:
        """Time between two values [s]."""
        return float(self.t[1] - self.t[0]) if len(self.t) > 1 else 1.0


def fig6(flight: PlottedFlight) -> "Figure":
    """Draw how all UAVs track airspeed and attitude.

    Panels: responses (a) to (d), tracking errors (e) to (h), synchronisation errors (i) to (l).
    The error axes fit the errors after the first second, but for brief transients, within ±5 m/s
    or deg; a note above a panel gives the extremes of what leaves it.
    """
    figure = style.new_figure(7.4)
    axes = figure.subplots(3, len(QUANTITIES), sharex=True)
    t = flight.recording.time_s
    uavs = list(enumerate(flight.names))
    draw_tracking(axes[0], flight)
    _draw_errors(axes[1], [_Curves(name, t, flight.error(i)) for i, name in uavs], "error")
    synchronisation = [_Curves(name, t, flight.sync_error(i)) for i, name in uavs]
    _draw_errors(axes[2], synchronisation, "sync. error")
    _finish(figure, axes, [flight])
    for axis in axes.flat:
        style.mark_loss(axis, flight)
    style.draw_legend(figure)
    return figure


def draw_tracking(axes: Sequence["Axes"], flight: PlottedFlight) -> None:
    """Draw the responses of all UAVs, and the reference, into four panels."""
    t = flight.recording.time_s
    responses = [_Curves(name, t, flight.response(i)) for i, name in enumerate(flight.names)]
    # on a path each UAV has a reference of its own
    name = "reference" if flight.scenario.mission is None else f"reference of {flight.names[0]}"
    _draw_responses(axes, responses, _Curves(name, t, flight.reference()))


def fig10(flights: Sequence[PlottedFlight], uav_id: int = 3) -> "Figure":
    """Draw how one UAV tracks under several controllers.

    Panels: responses (a) to (d), tracking errors (e) to (h), with the axes of `fig6`.
    """
    return _compare(flights, uav_id, None)


def fig11(flights: Sequence[PlottedFlight], uav_id: int = 3) -> "Figure":
    """Draw how one UAV tracks under several faults.

    Panels: responses (a) to (d), tracking errors while the faults act (e) to (h).
    """
    windows = fault_windows(flights, uav_id)
    if not windows:
        return _compare(flights, uav_id, None)
    start_s = min(window.start_s for window in windows) - _AROUND_S
    end_s = max(window.end_s for window in windows) + _AROUND_S
    return _compare(flights, uav_id, (max(start_s, 0.0), min(end_s, _duration_s(flights))))


def _compare(
    flights: Sequence[PlottedFlight], uav_id: int, seen_s: tuple[float, float] | None
) -> "Figure":
    """Compare flights of one UAV; errors within a time window [s], or over the whole flight."""
    figure = style.new_figure(5.3)
    axes = figure.subplots(2, len(QUANTITIES), sharex="row")
    responses, errors, references = [], [], []
    for flight in flights:
        t, i = flight.recording.time_s, flight.recording.uav_ids.index(uav_id)
        responses.append(_Curves(flight.title, t, flight.response(i)))
        errors.append(_Curves(flight.title, t, flight.error(i)))
        references.append(_Curves("reference", t, flight.reference(i)))
    _draw_responses(axes[0], responses, max(references, key=lambda curves: len(curves.t)))
    if seen_s is None:
        _draw_errors(axes[1], errors, "error")
    else:
        _draw_errors(axes[1], _during(errors, *seen_s), "error", zoom=True)
    _finish(figure, axes, flights, uav_id)
    if seen_s is not None:
        axes[1, 0].set_xlim(*seen_s)
    style.draw_legend(figure)
    return figure


def _draw_responses(axes: Sequence["Axes"], curves: Sequence[_Curves], reference: _Curves) -> None:
    for k, quantity in enumerate(QUANTITIES):
        for i, one in enumerate(curves):
            style.draw_curve(
                axes[k], one.t, one.values[:, k], label=one.name, **style.style(i).line
            )
        target = reference.values[:, k]
        shown = [target, *(one.values[:, k] for one in curves)]
        if np.isfinite(target).any():  # of a foreign autopilot it is not known
            style.draw_curve(axes[k], reference.t, target, label=reference.name, **style.REFERENCE)
            low, high = style.usual_range(shown, reference.step_s)
            least, most = np.nanmin(target), np.nanmax(target)
            low, high = min(max(low, least - _BEYOND), least), max(min(high, most + _BEYOND), most)
            style.frame(axes[k], shown, low, high)
        axes[k].set_ylabel(f"{quantity} [{UNITS[quantity]}]")


def _draw_errors(
    axes: Sequence["Axes"], curves: Sequence[_Curves], name: str, zoom: bool = False
) -> None:
    for k, quantity in enumerate(QUANTITIES):
        settled = []
        for i, one in enumerate(curves):
            line = style.style(i).line
            if zoom:
                line["lw"] *= 0.6
            style.draw_curve(axes[k], one.t, one.values[:, k], label=one.name, **line)
            settled.append(one.values[one.t >= _SETTLING_S, k])
        low, high = style.usual_range(settled, curves[0].step_s)
        if not zoom:
            low, high = min(low, 0.0), max(high, 0.0)
            axes[k].axhline(0.0, color="black", lw=0.5)
        style.frame(
            axes[k], [one.values[:, k] for one in curves], max(low, -_ASTRAY), min(high, _ASTRAY)
        )
        axes[k].set_ylabel(f"{quantity} {name} [{UNITS[quantity]}]")


def _during(curves: Sequence[_Curves], start_s: float, end_s: float) -> list[_Curves]:
    seen = [(one.t >= start_s) & (one.t <= end_s) for one in curves]
    return [
        _Curves(one.name, one.t[at], one.values[at]) for one, at in zip(curves, seen, strict=True)
    ]


def _finish(
    figure: "Figure", axes: np.ndarray, flights: Sequence[PlottedFlight], uav_id: int | None = None
) -> None:
    for k, axis in enumerate(axes.flat):
        style.letter(axis, k)
        style.shade_faults(axis, flights, uav_id)
        style.tidy(axis, _duration_s(flights))
    figure.align_ylabels()


def _duration_s(flights: Sequence[PlottedFlight]) -> float:
    return max(flight.scenario.duration_s for flight in flights)

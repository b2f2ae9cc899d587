"""Figure 5: the UAVs' trajectories."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.reports.figures.flown import PlottedFlight
from gcs.reports.figures.style import SMALL, draw_legend, new_figure, style
from sitl_plant.airframe.rigid_body import R1

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PLACE = (-0.03, -0.05, 1.0, 1.1)  # of the axes in the figure; their corners are empty
_BOX = np.array([8.0, 4.4, 2.6])  # of north, east, altitude
_WING = 0.32  # half a span, in units of the box
_ABOVE = 0.15  # of a time above the aircraft, in heights of the box
_POINTS = 500  # of a path
_GLYPH = np.array(
    [
        [1.1, 0.0, 0.0],
        [-0.9, 0.0, 0.0],
        [np.nan] * 3,  # fuselage
        [0.2, -1.0, 0.0],
        [0.2, 1.0, 0.0],
        [np.nan] * 3,  # wing
        [-0.8, -0.4, 0.0],
        [-0.8, 0.4, 0.0],
        [np.nan] * 3,  # tailplane
        [-0.7, 0.0, 0.0],
        [-0.95, 0.0, -0.45],  # fin
    ]
)
"""An aircraft in body axes, in half spans."""


def fig5(flight: PlottedFlight, times_s: Sequence[float] = (0.0, 15.0, 24.0)) -> "Figure":
    """Draw the UAVs' paths over the ground, and the aircraft's attitude at some times [s].

    The axes' scales differ, so that turn and climb are visible; aircraft are drawn much too
    large, with the attitude that they would have at equal scales.
    """
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(5.2, layout=None)  # it cannot lay out three dimensions
    axis: Any = figure.add_axes(_PLACE, projection="3d")
    states = flight.recording.states
    paths = states[:, :, :3] * (1.0, 1.0, -1.0)
    low, high = _limits(paths)
    ground = low[2]
    stride = max(len(paths) // _POINTS, 1)
    for i, name in enumerate(flight.names):
        north, east, up = np.concatenate([paths[:-1:stride, i], paths[-1:, i]]).T
        axis.plot(north, east, up, label=name, **style(i).line)
        axis.plot(north, east, np.full_like(up, ground), color="0.8", lw=0.8)
    for step, text in _moments(flight, times_s):
        for i in range(len(flight.names)):
            at = paths[step, i]
            glyph = at + _aircraft(states[step, i]) * (high - low) / _BOX
            axis.plot(*glyph.T, color="black", lw=1.1, solid_capstyle="round", zorder=5)
            axis.plot(*np.array([at, [at[0], at[1], ground]]).T, color="0.7", lw=0.6)
        highest = paths[step, paths[step, :, 2].argmax()]
        axis.text(*highest[:2], highest[2] + _ABOVE * (high - low)[2], text, ha="center")
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(high[1], low[1])  # from east to west, or the turn would be mirrored
    axis.set_zlim(low[2], high[2])
    axis.set_xlabel("north [m]", labelpad=16.0)
    axis.set_ylabel("east [m]", labelpad=8.0)
    axis.set_zlabel("altitude [m]")
    axis.tick_params(labelsize=SMALL)
    axis.set_box_aspect(tuple(_BOX), zoom=1.3)
    axis.view_init(elev=24.0, azim=-65.0)
    for each in (axis.xaxis, axis.yaxis, axis.zaxis):
        each.set_pane_color((1.0, 1.0, 1.0, 0.0))
        each.set_major_locator(MaxNLocator(5))
        each._axinfo["grid"].update(color="0.9", linewidth=0.6)  # no public way
    for artist in axis.get_children():
        artist.set_clip_on(False)
    draw_legend(figure)
    return figure


def _limits(paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper limits of north, east, up [m], with room for the aircraft."""
    points = paths.reshape(-1, 3) if len(paths) else np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.maximum(1.2 * _WING / _BOX * (high - low), 2.0)
    return low - room, high + room


def _moments(flight: PlottedFlight, times_s: Sequence[float]) -> list[tuple[int, str]]:
    """Return step and label of each time that was flown, and of the end of a lost flight."""
    steps = len(flight.recording.states)
    moments = [
        (min(round(t / flight.step_s), steps - 1), f"{t:g} s")
        for t in times_s
        if steps and t <= flight.recording.duration_s
    ]
    if steps and flight.recording.loss is not None:
        moments.append((steps - 1, flight.lost))
    return moments


def _aircraft(state: np.ndarray) -> np.ndarray:
    """Return an aircraft with the attitude of a state: north, east, up, in units of the box."""
    to_ned = np.array(R1((state[6], state[7], state[8])))
    to_north_east_up = to_ned * [[1.0], [1.0], [-1.0]]
    glyph: np.ndarray = _WING * _GLYPH @ to_north_east_up.T
    return glyph

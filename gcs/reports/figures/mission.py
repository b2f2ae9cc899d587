"""A mission at a glance: the map, and how far from path, height, slots and each other UAVs were."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_autopilot.guidance.path import point_at
from gcs.reports.figures import style
from gcs.reports.figures.flown import PlottedFlight
from gcs.reports.figures.overview import draw_command
from gcs.results.mission_paths import silent_in
from gcs.results.path_following import PathErrors
from gcs.results.quantities import PAPER_ORDER
from gcs.results.recording import Recording
from gcs.results.separation import least_distances
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STANDS_M = 1.0
"""Who is no farther from where its flight ends stands there."""
_MOMENTS = 8  # at which the formation is drawn
_SHARE = 0.12  # of the map's size that a formation is drawn with
_AIRCRAFT = 0.016  # of the map's size
_STRAYED = 3.0  # from the middle of a formation, in its usual radii
_CLEAR = 30.0  # from the middle of a formation to its time [pt]
_GLYPH = np.array([(1.0, 0.0), (-0.7, 0.6), (-0.35, 0.0), (-0.7, -0.6)])  # ahead, right
_PATH_POINTS = 2000
_FAULT_WIDTH = 7.0  # [pt], of a track while a fault acts


def draw_mission(
    recording: Recording,
    scenario: Scenario,
    paths: np.ndarray,
    leaders: tuple[int, ...],
    folder: Path,
) -> None:
    """Draw the mission as `mission.png` and `mission.svg`; arguments as of `mission_figure`."""
    style.save(mission_figure(recording, scenario, paths, leaders), folder, "mission")


def mission_figure(
    recording: Recording, scenario: Scenario, paths: np.ndarray, leaders: tuple[int, ...]
) -> "Figure":
    """Draw the mission of a flight.

    Panels: the map, with the path, all tracks, and the formation at marked times, drawn larger
    than it is; distance from the slot (of a UAV without a formation: from the path), height error,
    least separation (of one UAV: its altitude); held commands. Faults are shaded.

    Args:
        recording: The flight, as of `gcs.results.preview.Preview`.
        scenario: What was flown.
        paths: As for `gcs.results.path_following.PathErrors`.
        leaders: As for `gcs.results.path_following.PathErrors`.
    """
    flight = PlottedFlight(scenario.name, scenario, recording)
    figure = style.new_figure(8.6, layout=None)
    grid = figure.add_gridspec(4, 4, height_ratios=(1.0, 1.0, 1.0, 0.9))
    below = [figure.add_subplot(grid[3, k]) for k in range(4)]
    beside: list[Axes] = [figure.add_subplot(grid[k, 2:], sharex=below[0]) for k in range(3)]
    chart = figure.add_subplot(grid[:3, :2])
    _draw_map(chart, flight, paths)
    silent = silent_in(scenario)
    errors = PathErrors(paths, leaders, recording.step_us, silent).of(recording.steps)
    _draw_errors(beside, flight, errors, bool(leaders))
    for axis, channel in zip(below, PAPER_ORDER, strict=True):
        draw_command(axis, flight, channel)
    for axis in (*beside, *below):
        style.shade_faults(axis, [flight])
        style.mark_loss(axis, flight)
        style.tidy(axis, scenario.duration_s)
    figure.align_ylabels(beside)
    lines = style.draw_legend(figure)
    for _ in range(2):  # the numbers of the map depend on its size, and its size on them
        style.fit_margins(figure, lines)
        _equal_scales(chart)
    return figure


def _draw_errors(
    axes: Sequence["Axes"], flight: PlottedFlight, errors: np.ndarray, in_formation: bool
) -> None:
    """Draw distances from slot or path, height errors, and separation or altitude over time."""
    t, distances = flight.recording.time_s, least_distances(flight.recording.states)[0]
    first = errors["slot"] if in_formation else errors["cross_track"]
    for axis, shown in zip(axes, (first, errors["height"]), strict=False):
        for i, curve in enumerate(shown.T):
            style.draw_curve(axis, t, curve, **style.style(i).thin)
        style.frame(axis, list(shown.T), *style.usual_range(list(shown.T), flight.step_s))
    axes[0].set_ylabel("from slot [m]" if in_formation else "cross-track [m]")
    axes[1].set_ylabel("height error [m]")
    if not np.isfinite(distances).any():
        axes[2].set_ylabel("altitude [m]")
        altitude = -flight.recording.states[:, 0, 2]
        style.draw_curve(axes[2], t, altitude, **style.style(0).thin)
        style.frame(axes[2], [altitude], *style.usual_range([altitude], flight.step_s))
    else:
        axes[2].set_ylabel("least separation [m]")
        style.draw_curve(axes[2], t, distances, color="black", lw=0.9)
        style.frame(axes[2], [distances], *style.usual_range([distances], flight.step_s))
        axes[2].set_ylim(bottom=0.0)
        style.note(axes[2], f"min {distances[np.isfinite(distances)].min():.1f} m")


def _draw_map(axis: "Axes", flight: PlottedFlight, paths: np.ndarray) -> None:
    tracks = flight.recording.states[:, :, 1::-1]  # east, north
    reached = flight.recording.signals["path_position"]
    furthest = np.max(reached, initial=-np.inf, where=~np.isnan(reached))  # none of foreign ones
    for i, path in enumerate(paths):
        if i == 0 or path["id"] != paths[0]["id"]:
            _draw_path(axis, path, float(furthest))
    _draw_faults(axis, flight)
    for i, name in enumerate(flight.names):
        axis.plot(*_thinned(tracks[:, i]).T, label=name, **style.style(i).thin)
    axis.plot(0.0, 0.0, "+", color="black", ms=9.0, mew=1.2, label="origin")
    axis.margins(0.18)
    axis.set_xlabel("east [m]")
    axis.set_ylabel("north [m]")
    style.tidy(axis)
    _draw_formations(axis, flight, tracks)


def _equal_scales(axis: "Axes") -> None:
    """Widen one of a map's axes, so that a metre is as long on both."""
    size, limits = np.array(axis.bbox.size), np.array([axis.get_xlim(), axis.get_ylim()])
    half = 0.5 * size * (np.ptp(limits, axis=1) / size).max()
    low, high = limits.mean(axis=1) - half, limits.mean(axis=1) + half
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def _thinned(track: np.ndarray) -> np.ndarray:
    return track[:: max(len(track) // _PATH_POINTS, 1)]


def _draw_path(axis: "Axes", path: np.void, flown_m: float) -> None:
    """Draw a path as far as it was flown, with the numbers of the items where they are passed."""
    end_m = flown_m if np.isfinite(flown_m) else float(path["start"][path["count"] - 1])
    found = [point_at(path, s) for s in np.linspace(0.0, max(end_m, 1.0), _PATH_POINTS)]
    points = np.array([(point.east, point.north) for point in found])
    over: dict[str, Any] = {"color": style.GREY, "zorder": 2.5}  # the tracks
    axis.plot(*points.T, ls=(0.0, (4.0, 3.0)), lw=0.8, label="path", **over)
    items = path["item"][[point.leg for point in found]]
    for k in np.flatnonzero(np.diff(items)):
        axis.plot(*points[k], "o", ms=3.0, **over)
        inwards = points.mean(axis=0) - points[k]
        _write(axis, str(items[k]), points[k], inwards, 9.0, style.GREY)


def _write(
    axis: "Axes", text: str, at: np.ndarray, towards: np.ndarray, away: float, colour: str
) -> None:
    """Write a short text beside a point, in a direction, so far away [pt]."""
    offset = away * towards / max(float(np.hypot(*towards)), 1e-9)
    axis.annotate(
        text,
        (float(at[0]), float(at[1])),
        xytext=(float(offset[0]), float(offset[1])),
        textcoords="offset points",
        size=style.SMALL,
        ha="center",
        va="center",
        color=colour,
    )


def _draw_faults(axis: "Axes", flight: PlottedFlight) -> None:
    """Mark the part of a UAV's track that it flew with a fault."""
    ids, t = flight.recording.uav_ids, flight.recording.time_s
    for fault in flight.scenario.faults:
        end_s = flight.scenario.duration_s if fault.end_s is None else fault.end_s
        within = (t >= fault.start_s) & (t <= end_s)
        track = _thinned(flight.recording.states[within, ids.index(fault.uav), 1::-1])
        axis.plot(*track.T, color="0.82", lw=_FAULT_WIDTH, solid_capstyle="butt", zorder=0)


def _draw_formations(axis: "Axes", flight: PlottedFlight, tracks: np.ndarray) -> None:
    """Draw the UAVs at some times, far enough apart to see each, and the links between them.

    One that has strayed is drawn where it is, without links.
    """
    if not len(tracks):
        return
    steps = np.linspace(0, _moving(tracks) - 1, _MOMENTS + 1).astype(int)[:-1]
    low, high = axis.get_xlim(), axis.get_ylim()
    size = max(low[1] - low[0], high[1] - high[0])
    middles = np.nanmedian(tracks[steps], axis=1, keepdims=True)
    apart = np.hypot(*np.moveaxis(tracks[steps] - middles, -1, 0))
    spread = float(np.nanmedian(apart.max(axis=1)))
    larger = _round_factor(_SHARE * size / 2.0 / spread) if spread > 0.0 else 1.0
    index = {system: i for i, system in enumerate(flight.recording.uav_ids)}
    yaw = flight.recording.states[:, :, 8]
    for step, middle, near in zip(steps, middles[:, 0], apart <= _STRAYED * spread, strict=True):
        drawn = middle + np.where(near, larger, 1.0)[:, None] * (tracks[step] - middle)
        for edge in flight.scenario.network.edges:
            a, b = (index[system] for system in edge.between)
            if near[a] and near[b]:
                axis.plot(*drawn[[a, b]].T, color="0.5", lw=0.6, zorder=3)
        for i in range(len(flight.names)):
            corners = _aircraft(drawn[i], yaw[step, i], _AIRCRAFT * size)
            axis.fill(*corners.T, style.style(i).colour, zorder=4)
        outwards = middle - np.nanmean(middles[:, 0], axis=0)
        text = f"{flight.recording.time_s[step]:.0f} s"
        _write(axis, text, middle, outwards, _CLEAR, "black")
    if larger > 1.0:
        style.note(axis, f"formation drawn {larger:g} times larger")


def _moving(tracks: np.ndarray) -> int:
    """Return how many steps there are before all stand, at least 1."""
    off = np.hypot(*np.moveaxis(tracks - tracks[-1], -1, 0)).max(axis=1)
    moving = np.flatnonzero(off > _STANDS_M)
    return int(moving[-1]) + 1 if len(moving) else len(tracks)


def _round_factor(factor: float) -> float:
    """Return the largest of 1, 2, 3, 5, 10, 20, … that is not larger, at least 1."""
    if not factor >= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(factor))
    return float(max(m * power for m in (1.0, 2.0, 3.0, 5.0) if m * power <= factor))


def _aircraft(place: np.ndarray, yaw: float, size: float) -> np.ndarray:
    """Return the corners of an aircraft: east and north."""
    ahead, right = size * _GLYPH.T
    sin_yaw, cos_yaw = np.sin(yaw), np.cos(yaw)
    east = place[0] + sin_yaw * ahead + cos_yaw * right
    north = place[1] + cos_yaw * ahead - sin_yaw * right
    return np.column_stack([east, north])

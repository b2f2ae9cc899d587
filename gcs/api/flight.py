"""A flight that was flown: figures, events and trajectory, with names and units."""

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn, Self

import numpy as np

from gcs.api import tables
from gcs.console.errors import BadInput, FlightLost, python_errors
from gcs.console.extras import load_package
from gcs.console.terminal import as_html, as_text
from gcs.results.columns import COLUMNS
from gcs.results.figures import FLIGHT_FIGURES, UAV_FIGURES, FlightSummary
from gcs.results.quantities import percent
from gcs.results.recording import Ending, Recording
from gcs.results.run_folder import SCENARIO, read_summary
from gcs.results.store import EVENTS, TRAJECTORY, is_complete, read_table, stream_of
from gcs.scenario.model import Scenario, read_scenario

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr
    from matplotlib.figure import Figure
    from rich.console import Group

_WIDTH = 100
_STATES = tuple(column.name for column in COLUMNS if column.array == "states")


@dataclass(frozen=True)
class Source:
    """Where the parts of a flight are; each is read when it is asked for.

    Attributes:
        summary: Returns its figures.
        scenario: Returns what was flown.
        trajectory: Of its trajectory, a file or memory; None if it was not recorded.
        events: The same of its events.
        folder: Its run folder; None without one.
    """

    summary: Callable[[], FlightSummary]
    scenario: Callable[[], Scenario]
    trajectory: "Path | pa.Buffer | None"
    events: "Path | pa.Buffer | None"
    folder: Path | None = None


class Flight:
    """A flight that was flown, or what was recorded of it.

    Frames, datasets and figures are read from its recording when they are asked for. Units are SI
    and rad, as in the files of `gcs fly` and `gcs export`; with ``degrees=True`` angles are deg.
    The attribute ``attrs["units"]`` of a frame, and ``attrs["units"]`` of a variable of a dataset,
    name them.

    Any library that takes Arrow takes a flight: ``polars.DataFrame(flight)`` is its trajectory.

    Attributes:
        folder: Its run folder; None without one.
        remarks: What was to be known before it was flown here; none of one that was opened.
    """

    def __init__(self, source: Source, remarks: Sequence[str] = ()) -> None:
        self._source = source
        self.remarks = tuple(remarks)
        self.folder = source.folder

    # what is known of it

    @functools.cached_property
    def summary(self) -> FlightSummary:
        """Its figures, as in `summary.json`.

        Raises:
            BadInput: The run folder has none: the flight broke off.
        """
        with python_errors():
            return self._source.summary()

    @functools.cached_property
    def scenario(self) -> Scenario:
        """What was flown, with all changes.

        Raises:
            BadInput: The run folder, of an earlier version, does not have it.
        """
        with python_errors():
            return self._source.scenario()

    @property
    def completed(self) -> bool:
        """Whether it reached the scenario's end, and all laws controlled it."""
        return self.summary.completed

    @property
    def loss(self) -> str | None:
        """Why it was lost; None if it was not."""
        return self.summary.loss

    def check(self) -> Self:
        """Return the flight if it was completed.

        Raises:
            FlightLost: It was lost, with the reason that `gcs fly` gives.
        """
        if self.summary.loss is not None:
            raise FlightLost(self.summary.loss)
        return self

    @property
    def torn(self) -> bool:
        """Whether the files of its recording were not written to their end."""
        sources = (self._source.trajectory, self._source.events)
        return any(isinstance(one, Path) and not is_complete(one) for one in sources)

    # tables

    @functools.cached_property
    def table(self) -> "pa.Table":
        """Its trajectory as an Arrow table: one row per recorded step and UAV.

        Its columns are `gcs.results.columns.COLUMNS`, or the part of them that was recorded.

        Raises:
            BadInput: It was not recorded.
        """
        return self._read(self._source.trajectory)

    @functools.cached_property
    def event_table(self) -> "pa.Table":
        """Its events as an Arrow table: `time_s`, `step`, `uav`, `actuator`, `value`.

        Raises:
            BadInput: They were not recorded.
        """
        return self._read(self._source.events)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Return the trajectory by the Arrow PyCapsule interface."""
        return self.table.__arrow_c_stream__(requested_schema)

    def frame(
        self, columns: Iterable[str] | None = None, *, uav: int | None = None, degrees: bool = False
    ) -> "pd.DataFrame":
        """Return its trajectory as a frame of pandas, indexed by `time_s` and `uav`.

        Args:
            columns: Names of columns, such as ``["roll", "reference_roll"]``; None for all.
            uav: System id; None for all UAVs.
            degrees: Whether angles are in deg.

        Raises:
            BadInput: It was not recorded, there is no such column or UAV, or no pandas.
        """
        with python_errors():
            table = tables.chosen(self.table, columns, uav, degrees)
            frame: pd.DataFrame = tables.trajectory_frame(table, degrees, self._attributes)
            return frame

    @property
    def states(self) -> "pd.DataFrame":
        """Its true states as a frame: place [m], velocity in body axes [m/s], angles, rates [rad].

        Raises:
            BadInput: As of `frame`.
        """
        return self.frame(_STATES)

    @property
    def events(self) -> "pd.DataFrame":
        """Its events as a frame: `time_s`, `step`, `uav`, `actuator`, `value` [rad, throttle N].

        Raises:
            BadInput: They were not recorded, or there is no pandas.
        """
        with python_errors():
            return tables.event_frame(self.event_table, False, self._attributes)

    @property
    def figures(self) -> "pd.DataFrame":
        """The figures of each UAV as a frame, as in the results of a campaign.

        Raises:
            BadInput: There is no pandas.
        """
        with python_errors():
            pandas = load_package("pandas", "a frame")
        uavs = self.summary.uavs
        columns = {
            figure.name: np.array([figure.of(uav) for uav in uavs], "i8" if figure.whole else "f8")
            for figure in UAV_FIGURES
        }
        index = pandas.Index([uav.id for uav in uavs], name="uav")
        frame: pd.DataFrame = pandas.DataFrame(columns, index=index)
        units = {figure.name: figure.unit for figure in UAV_FIGURES if figure.unit}
        frame.attrs = {**self._attributes, "units": units}
        return frame

    def dataset(
        self, columns: Iterable[str] | None = None, *, degrees: bool = False
    ) -> "xr.Dataset":
        """Return its trajectory as a dataset of xarray with dimensions `time_s` and `uav`.

        Args:
            columns: As of `frame`.
            degrees: As of `frame`.

        Raises:
            BadInput: As of `frame`; or there is no xarray.
        """
        with python_errors():
            table = tables.chosen(self.table, columns, None, degrees)
            return tables.dataset(table, degrees, self._names, self._attributes)

    # figures

    def plot(self, kind: Literal["overview", "mission"] = "overview") -> "Figure":
        """Draw it as `flight.png`, or as `mission.png`, of `gcs fly`; a notebook shows it.

        Args:
            kind: What is drawn.

        Raises:
            BadInput: It was not recorded, or has no mission.
        """
        from gcs.reports.figures.mission import mission_figure
        from gcs.reports.figures.overview import overview
        from gcs.results.mission_paths import leaders_of, paths_of
        from gcs.results.preview import recorded_gaps

        with python_errors():
            shown, scenario = self._shown(), self.scenario
            if kind == "overview":
                return overview(shown, scenario, recorded_gaps(self.event_table, shown.uav_ids))
            if kind != "mission":
                raise BadInput(f"kind: expected 'overview' or 'mission', got {kind!r}")
            if (paths := paths_of(scenario)) is None:
                raise BadInput("the scenario has no mission")
            return mission_figure(shown, scenario, paths, leaders_of(scenario))

    def _shown(self) -> Recording:
        """Return its recording, as thin as a figure can show it."""
        from gcs.results.preview import recorded_steps

        ids = tuple(uav.id for uav in self.scenario.uavs)
        if not len(self.table):
            raise BadInput("the recording has no complete step")
        steps, every = recorded_steps(self.table, len(ids))
        loss, mode = self._ended
        ending = Ending(mode, steps.length, np.zeros((len(ids), 4), np.int64), 0.0, loss)
        about = self.table.schema.metadata
        step_us = int(about[b"step_us"]) * int(about[b"every"]) * every
        return Recording.of(steps, ending, ids, step_us)

    @property
    def _ended(self) -> tuple[str | None, Any]:
        try:
            return self.summary.loss, self.summary.mode
        except BadInput as problem:
            return str(problem), "lockstep"

    # texts

    def __repr__(self) -> str:
        try:
            summary = self.summary
        except BadInput as problem:
            return f"<flight in {self.folder}, which broke off>" if self.folder else f"<{problem}>"
        outcome = "completed" if summary.loss is None else summary.loss
        return (
            f"<flight of {summary.scenario!r}: {summary.duration_s:g} s, {outcome}, "
            f"saved {percent(summary.saving)}>"
        )

    def __str__(self) -> str:
        return as_text(self.__rich__(), width=_WIDTH)

    def __rich__(self) -> "Group":
        """Return the tables that `gcs fly` prints."""
        from rich.console import Group

        from gcs.reports.flight import flight_tables

        return Group(*flight_tables(self.summary, self.scenario))

    def _repr_html_(self) -> str:
        """Return the tables as HTML, for notebooks."""
        return as_html(self.__rich__(), width=_WIDTH)

    # inside

    @property
    def _names(self) -> Mapping[int, str]:
        try:
            return {uav.id: uav.name for uav in self.scenario.uavs}
        except BadInput:  # a log has none
            return {}

    @property
    def _attributes(self) -> dict[str, Any]:
        """What a frame or a dataset says of its flight."""
        try:
            summary = self.summary
        except BadInput:
            return {}
        figures = (figure for figure in FLIGHT_FIGURES if figure.name != "wall_s")
        known = {figure.name: figure.of(summary) for figure in figures}
        about = {"scenario": summary.scenario, "mode": summary.mode, "loss": summary.loss or ""}
        return about | {name: value for name, value in known.items() if value is not None}

    def _read(self, source: "Path | pa.Buffer | None") -> "pa.Table":
        with python_errors():
            if source is None:
                raise BadInput(
                    "this flight was not recorded", "fly it with record='light' or record='full'"
                )
            return read_table(source)


def open_run(folder: Path | str) -> Flight:
    """Open the run folder of a flight that was flown by `gcs fly`, or by `fly` with `out`.

    Its parts are read when they are asked for; a recording that was torn, up to its last complete
    batch. A log of any autopilot, as `gcs log` reads it, is opened as well: it has a trajectory, at
    the rate of its fastest channel, and remarks; no events, figures or scenario.

    Args:
        folder: The folder, or the log.

    Raises:
        BadInput: It is no run folder and no log.
    """
    folder = Path(folder)
    if folder.is_file():
        with python_errors():
            return _of_log(folder)
    trajectory, events = folder / TRAJECTORY, folder / EVENTS
    with python_errors():
        if not (trajectory.exists() or (folder / "summary.json").exists()):
            raise BadInput(
                f"{folder} is no run folder: it has neither {TRAJECTORY} nor summary.json",
                "gcs fly writes them to runs/NAME-DATE-TIME, or to --out FOLDER",
            )
    return Flight(
        Source(
            lambda: read_summary(folder),
            lambda: read_scenario(folder / SCENARIO),
            trajectory if trajectory.exists() else None,
            events if events.exists() else None,
            folder,
        )
    )


def _of_log(path: Path) -> Flight:
    """Return the flight in a log."""
    from gcs.results.logs.as_recording import recording_of
    from gcs.results.logs.read import read_flight

    def absent() -> NoReturn:
        raise BadInput(f"{path} is a log: it has no figures and no scenario")

    flight = read_flight(path)
    return Flight(Source(absent, absent, stream_of(recording_of(flight)), None), flight.remarks)

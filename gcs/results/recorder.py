"""What is kept of a flight, while it is flown: figures always, and what `--record` says."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from gcs.results.choices import Record
from gcs.results.columns import Column, columns_of
from gcs.results.export import save_arrays_of
from gcs.results.figures import FlightSummary
from gcs.results.mission_paths import paths_of
from gcs.results.preview import Preview
from gcs.results.recording import Ending, Recording, Steps, events_of
from gcs.results.run_folder import save_summary
from gcs.results.store import EVENTS, TRAJECTORY, EventStream, TrajectoryStream, row_size
from gcs.results.summary import summary_of
from gcs.results.tally import Tally
from gcs.scenario.itinerary import outline
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    import pyarrow as pa

LIGHT_PERIOD_US = 20_000
"""Steps of a light recording are so far apart, or one control period."""


def trajectory_bytes(scenario: Scenario, record: Record) -> int:
    """Return the most that the trajectory of a whole flight takes on disk [bytes]."""
    if record is Record.NONE:
        return 0
    columns, every = _layout(scenario, record)
    return -(-scenario.steps // every) * len(scenario.uavs) * row_size(columns)


def _layout(scenario: Scenario, record: Record) -> tuple[tuple[Column, ...], int]:
    """Return the columns of a trajectory, and how many steps a recorded one stands for."""
    light = record is Record.LIGHT
    columns = columns_of(light=light, estimated=scenario.navigation == "estimated")
    return columns, max(LIGHT_PERIOD_US // scenario.step_us, 1) if light else 1


def streams_of(
    scenario: Scenario, folder: Path | None, record: Record
) -> tuple[EventStream, TrajectoryStream]:
    """Make the files of events and trajectory of a full or light recording; None for memory.

    Raises:
        OSError: With a file's name.
    """
    columns, every = _layout(scenario, record)
    events = EventStream(None if folder is None else folder / EVENTS, scenario.step_us)
    trajectory = TrajectoryStream(
        None if folder is None else folder / TRAJECTORY,
        columns,
        every,
        tuple(uav.id for uav in scenario.uavs),
        scenario.step_us,
        compressed=record is Record.LIGHT,
        about={
            "scenario": scenario.name,
            "origin": scenario.origin.model_dump_json(),
            "names": json.dumps({str(uav.id): uav.name for uav in scenario.uavs}),
            "paths": json.dumps(_outlines(scenario)),
            "limits": json.dumps(
                {str(u.id): asdict(scenario.aircraft_of(u.id).fault_limits) for u in scenario.uavs}
            ),
        },
    )
    return events, trajectory


class FlightRecorder:
    """Takes the steps of a flight, and stores what `--record` asks for.

    Attributes:
        preview: The flight, thinned out for a figure.
        trajectory: Content of `trajectory.arrows` of a flight that is recorded in memory and over.
        events: Content of `events.arrows` of such a flight.
    """

    def __init__(self, scenario: Scenario, folder: Path | None, record: Record) -> None:
        """Make the files.

        Args:
            scenario: What is flown.
            folder: Run folder, exists; None to record in memory, which .npz cannot.
            record: How much is kept.

        Raises:
            OSError: A file cannot be written; it is named.
        """
        self._scenario, self._folder = scenario, folder
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self._tally = Tally(scenario)
        self.preview = Preview(scenario)
        self._whole: list[Steps] | None = [] if record is Record.NPZ else None
        self._trajectory: TrajectoryStream | None = None
        self._events: EventStream | None = None
        self.trajectory: pa.Buffer | None = None
        self.events: pa.Buffer | None = None
        if record in {Record.FULL, Record.LIGHT}:
            self._events, self._trajectory = streams_of(scenario, folder, record)

    def load_code(self) -> None:
        """Load the compiled code of the counts, so that no flight waits for it."""
        Tally(self._scenario).add(Steps.room(1, len(self._ids)))

    def add(self, steps: Steps) -> None:
        """Take the next steps; OSError with a file's name if it cannot be written."""
        events = events_of(steps.signals, steps.first, self._ids, self._scenario.step_us)
        self._tally.add(steps)
        self.preview.add(steps, events)
        if self._events is not None:
            self._events.add(events)
        if self._trajectory is not None:
            self._trajectory.add(steps)
        if self._whole is not None:
            self._whole.append(Steps(steps.first, *(array.copy() for array in steps[1:])))

    def close(self) -> None:
        """Complete the files of the recording, also of a flight that broke off.

        Raises:
            OSError: With a file's name.
        """
        events, trajectory = self._events, self._trajectory
        self._events = self._trajectory = None
        if events is not None:
            events.close()
        if trajectory is not None:
            trajectory.close()
        if events is not None and trajectory is not None and self._folder is None:
            self.events, self.trajectory = events.content(), trajectory.content()

    def finish(self, ending: Ending) -> FlightSummary:
        """Complete the recording and write `summary.json`, with a folder; return the figures.

        Raises:
            OSError: A file cannot be written; it is named.
        """
        summary = summary_of(self._tally, ending, self._scenario)
        if self._folder is not None:
            save_summary(summary, self._folder)
        self.close()
        if self._whole is not None and self._folder is not None:
            whole = Steps.joined(self._whole, len(self._ids))
            recording = Recording.of(whole, ending, self._ids, self._scenario.step_us)
            save_arrays_of(recording, self._folder)
        return summary


def _outlines(scenario: Scenario) -> dict[str, list[tuple[float, float, float]]]:
    """Return the corners of each path by who flies it, such as "1, 2, 3"."""
    paths = paths_of(scenario)
    if paths is None:
        return {}
    own = {uav.id: path for uav, path in zip(scenario.uavs, paths, strict=True)}
    groups = {int(path["id"]): [i for i in own if own[i]["id"] == path["id"]] for path in paths}
    return {", ".join(map(str, ids)): outline(own[ids[0]]) for ids in groups.values()}

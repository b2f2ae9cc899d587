"""The points of a sweep with their flights, as its tables and its plot show them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from ftc_lab.campaigns.grid import SweepGrid
from ftc_lab.campaigns.store import read_results
from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario
from gcs.scenario.settings import label

_FLOWN = {"heading_lost": "completed", "attitude_lost": "completed", "model_left": "lost"}
"""Outcomes of the campaign that are others here: a table tells what its one UAV lost."""


@dataclass(frozen=True)
class Point:
    """One point of the grid.

    Attributes:
        row: Its row in the campaign.
        file: Name of its scenario file among the sweep's.
        values: Labels of the values laid over the file, by key.
        scenario: File and values together; None if they are not a valid scenario.
        outcome: ``completed``; ``lost``, ``crashed``, ``failed``, ``invalid`` as in a campaign.
        reason: Why it was not flown to its end; else empty.
        figures: Columns of the results.
    """

    row: int
    file: str
    values: Mapping[str, str]
    scenario: Scenario | None
    outcome: str
    reason: str
    figures: Mapping[str, Any]

    def uav_ids(self) -> list[int]:
        """Return the UAVs that have figures."""
        if self.scenario is None or self.figures["duration_s"] is None:
            return []
        return [uav.id for uav in self.scenario.uavs]

    def uav(self, uav_id: int) -> Mapping[str, Any]:
        """Return the figures of one UAV, by their names without it."""
        start = f"uav{uav_id}."
        return {
            name.removeprefix(start): value
            for name, value in self.figures.items()
            if name.startswith(start)
        }


def read_points(folder: Path, grid: SweepGrid) -> list[Point]:
    """Read what was flown of a sweep, one file after the other.

    Raises:
        BadInput: The results cannot be read.
    """
    flights = grid.plan.flights
    points = []
    for row in read_results(folder).to_pylist():
        outcome = _FLOWN.get(row["outcome"], row["outcome"])
        points.append(
            Point(
                row["row"],
                row["variant"],
                {key: label(value) for key, value in flights.values(row).items()},
                grid.scenarios[row["row"]],
                outcome,
                "" if outcome == "completed" else row["reason"],
                row,
            )
        )
    files = list(flights.trees)
    return sorted(points, key=lambda point: (files.index(point.file), point.row))


def choose_uav(scenarios: Iterable[Scenario | None], chosen: int | None) -> int | None:
    """Return the UAV that table.md and the plot show.

    Args:
        scenarios: Of the points of the grid; None of those that cannot be flown.
        chosen: System id; None for the first UAV with a fault, or else the last UAV.

    Returns:
        Its system id; None if no point can be flown.

    Raises:
        BadInput: No point has this UAV.
    """
    known = [scenario for scenario in scenarios if scenario is not None]
    if not known:
        return chosen
    ids = sorted({uav.id for scenario in known for uav in scenario.uavs})
    if chosen is None:
        faulted = [fault.uav for scenario in known for fault in scenario.faults]
        return faulted[0] if faulted else known[0].uavs[-1].id
    if chosen not in ids:
        raise BadInput(f"--uav is {chosen}, expected one of {', '.join(map(str, ids))}")
    return chosen


def uav_of(point: Point, uav_id: int | None) -> Mapping[str, Any] | None:
    """Return a UAV's figures in a complete flight; None if the flight is not complete."""
    if point.outcome != "completed" or uav_id not in point.uav_ids():
        return None
    return point.uav(uav_id)


Dimension: TypeAlias = tuple[str, list[str]]
"""A column of the tables and a dimension of the plot: its name, and labels of its values."""

FILE = "scenario"
"""The dimension of the files."""


def dimensions_of(points: Sequence[Point]) -> list[Dimension]:
    """Return the keys that were swept, and the files if there are several."""
    names = [*points[0].values, FILE]
    axes = [(name, list(dict.fromkeys(position(p, name) for p in points))) for name in names]
    return [axis for axis in axes if axis[0] != FILE or len(axis[1]) > 1]


def position(point: Point, name: str) -> str:
    """Return the label of a point in a dimension."""
    return point.file if name == FILE else point.values.get(name, "")

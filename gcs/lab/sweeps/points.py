"""The points of a sweep with their flights, as its tables and its plot show them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.lab.campaigns.store import read_results
from gcs.lab.sweeps.grid import Grid
from gcs.scenario.model import Scenario
from gcs.scenario.settings import label

_FLOWN = {"heading_lost": "completed", "attitude_lost": "completed", "model_left": "lost"}
"""Outcomes of the campaign that are others here: a table tells what its one UAV lost."""


@dataclass(frozen=True)
class Point:
    """One point of the grid.

    Attributes:
        row: Its row in the campaign.
        file: Name of its scenario file among those of the sweep.
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


def read_points(folder: Path, grid: Grid) -> list[Point]:
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

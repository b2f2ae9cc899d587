"""Sweeps flown in this process, without workers."""

from pathlib import Path

from ftc_lab.campaigns.flights import fly_rows
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.grid import plan_grid
from ftc_lab.campaigns.plan import rows_of
from ftc_lab.campaigns.points import Point, read_points
from ftc_lab.campaigns.store import append_results
from gcs.scenario.settings import parse_axes


def swept(files: list[Path], settings: list[str], folder: Path) -> list[Point]:
    """Fly every point of a grid; `settings` are as after `--set`."""
    grid = plan_grid(files, parse_axes(settings))
    open_folder(folder, grid.plan)
    rows = list(rows_of(grid.plan.draws))
    append_results(folder, fly_rows(grid.plan.flights, rows))
    return read_points(folder, grid)

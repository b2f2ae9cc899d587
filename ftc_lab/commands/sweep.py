"""``gcs sweep``: fly a grid of values on all cores."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ftc_lab.commands.flights import JobsOption, fly_plan, interruptible
from gcs.commands.common import QuietOption, tell
from gcs.console.errors import GcsError
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.scenario.settings import parse_axes

if TYPE_CHECKING:
    from ftc_lab.campaigns.points import Point


def sweep(
    scenarios: Annotated[list[Path], typer.Argument(metavar="SCENARIO")],
    axes: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE,VALUE,...")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None,
    jobs: JobsOption = None,
    uav: Annotated[int | None, typer.Option(metavar="ID")] = None,
    quiet: QuietOption = False,
) -> None:
    """Fly every combination of values, in process, on all cores.

    A sweep is the grid case of a campaign, and so is its folder: flights are stored every
    few seconds, and after an interruption, the same command continues there. Lost flights and
    impossible values are recorded with their reasons. The folder gets table.csv (every UAV),
    table.md, and sweep.png and sweep.svg: saving against IAE.

    Args:
        scenarios: Scenarios: files, or bundled ones.
        axes: A key of the scenario and its values, in YAML. With several, every combination is
            flown.
        out: Folder of the sweep, new or to continue; runs/sweep-NAME-DIGEST by default, the same
            for the same scenarios, values and code.
        uav: UAV in table.md and plot; by default one with a fault, or the last.

    Examples:
        - gcs sweep paper/scenario1 --set trigger.b2_deg=0.25,0.5,1,2
        - gcs sweep paper/scenario1 --set trigger.mode=per_channel,joint
          --set uncertainty.coefficients=0.8,1,1.2 --out runs/robust
        - gcs sweep scenarios/paper/scenario2_*.yaml --set 'faults[0].effectiveness=0.9,0.5,0.1'
          --uav 3
        - gcs sweep my.yaml --set 'controller.K1=[40, 40, 40], [50, 50, 50]' --jobs 2

    Exit status: 0 the sweep is complete (lost flights and single impossible values are results
    too), 1 a flight could not be computed or written, 2 bad input, such as a key none of whose
    values is valid, 70 a defect of ftc-sitl, 130 Ctrl-C; the same command continues.
    """
    from ftc_lab.campaigns.folder import default_folder, open_folder
    from ftc_lab.campaigns.grid import plan_grid
    from ftc_lab.campaigns.points import choose_uav, read_points
    from gcs.fleet.preparation import checked

    console = console_of(quiet=quiet)
    grid = plan_grid(scenarios, parse_axes(axes or []))
    uav_id = choose_uav(grid.scenarios, uav)
    folder = out or default_folder(grid.plan.mark, "sweep")
    if grid.plan.example is not None:
        tell(checked(grid.plan.example), console)
    open_folder(folder, grid.plan)
    with interruptible(folder, len(grid.scenarios)):
        fly_plan(grid.plan, folder, jobs, console)
        _report(read_points(folder, grid), uav_id, folder, console)


def _report(points: list["Point"], uav_id: int | None, folder: Path, console: Console) -> None:
    from ftc_lab.figures.sweep import draw_sweep
    from ftc_lab.reports.sweep import terminal_table, write_csv, write_markdown

    write_csv(points, folder / "table.csv")
    write_markdown(points, uav_id, folder / "table.md")
    with working(console, "drawing sweep.png"):
        draw_sweep(points, uav_id, folder)
    output = console_of(stderr=False, quiet=console.quiet)
    output.print(terminal_table(points, uav_id))
    output.print(f"results in {folder}", soft_wrap=True)
    invalid = [point.reason for point in points if point.outcome == "invalid"]
    if invalid:
        text = f"{len(invalid)} of {len(points)} points have values that are no scenario"
        console.print(f"{text}: {invalid[0]}; each is named in table.md", soft_wrap=True)
    failed = [point.reason for point in points if point.outcome == "failed"]
    if failed:
        raise GcsError(f"{len(failed)} of {len(points)} flights could not be computed: {failed[0]}")

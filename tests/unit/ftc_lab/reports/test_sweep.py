"""The tables and the plot of a sweep."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from sweeping import swept

from ftc_lab.campaigns.grid import plan_grid
from ftc_lab.campaigns.points import Point, choose_uav
from ftc_lab.figures.sweep import draw_sweep
from ftc_lab.reports.sweep import terminal_table, write_csv, write_markdown
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise
from gcs.scenario.settings import parse_axes


def test_the_uav_with_a_fault_is_shown_or_else_the_last(short: Path) -> None:
    axes = parse_axes(["faults=[{uav: 1, actuator: rudder, bias_deg: 1, start_s: 0}],[]"])
    faulted, healthy = plan_grid([short], axes).scenarios
    assert choose_uav([healthy, faulted], None) == 1
    assert choose_uav([healthy], None) == 3
    assert choose_uav([healthy], 2) == 2
    with pytest.raises(BadInput, match="expected one of 1, 2, 3"):
        choose_uav([healthy], 9)


def summary_of(point: Point) -> FlightSummary:
    """Fly a point again."""
    assert point.scenario is not None
    return summarise(fly_in_process(point.scenario), point.scenario)


def test_report_has_every_point(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    stuck = "[{uav: 2, actuator: throttle, stuck_n: 2000, start_s: 0}]"
    settings = ["trigger.b2_deg=0.5,1,-1", f"faults=[],{stuck}", "duration_s=0.05"]
    points = swept([short], settings, folder)
    write_csv(points, folder / "table.csv")
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 3 + 2
    assert [row["outcome"] for row in rows[-2:]] == ["invalid"] * 2
    uavs = [(point, uav) for point in points[:4] for uav in (1, 2, 3)]
    for row, (point, uav) in zip(rows[:-2], uavs, strict=True):
        summary = summary_of(point).uav(uav)
        assert summary is not None
        assert float(row["iae_yaw_deg_s"]) == summary.iae["yaw"]
        assert (row["uav"], row["scenario"], row["row"]) == (str(uav), "short", str(point.row))
        assert int(row["events_rudder"]) == summary.channels["rudder"].events
        assert row["trigger.b2_deg"] == point.values["trigger.b2_deg"]
    assert [row["trigger.b2_deg"] for row in rows[::6]] == ["0.5", "1", "-1"]
    write_markdown(points, 3, folder / "table.md")
    assert (folder / "table.md").read_text().count("\n| ") == 1 + 1 + 6
    assert terminal_table(points, 3).row_count == 6
    draw_sweep(points, 3, folder)
    assert (folder / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "sweep.svg").read_text().startswith("<?xml")


def test_neighbour_messages_have_columns_where_a_trigger_is_swept(
    short: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    points = swept([short], ["links.formation.trigger=null,{}", "duration_s=0.05"], folder)
    write_csv(points, folder / "table.csv")
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["neighbour_messages"] for row in rows[:3]] == ["98", "49", "49"]
    assert [float(row["neighbour_saving"]) for row in rows[:3]] == [0.0] * 3
    assert all(0 < int(row["neighbour_messages"]) < 40 for row in rows[3:])
    write_markdown(points, 3, folder / "table.md")
    head, _, periodic, triggered = (folder / "table.md").read_text().splitlines()[2:]
    assert "| neighbour messages | neighbour messages saved |" in head
    assert "| 49 | 0.00 % |" in periodic
    assert "| 49 |" not in triggered
    assert len(terminal_table(points, 3).columns) == 2 + 1 + 4 + 1


def test_points_that_a_simpler_law_flies_better_are_bold(short: Path, tmp_path: Path) -> None:
    settings = ["controller.kind=surviving,pid", "seed=1,2"]
    points = swept([short], settings, tmp_path / "out")
    figures = {"surviving": (9.0, 0.99), "pid": (2.0, 0.98)}
    changed = []
    for point in points:
        roll, saving = figures[point.values["controller.kind"]]
        if point.values["seed"] == "2":
            roll = 5.0  # of both, with other noise: no matter what seed 1 came to
        own = {"uav3.iae_roll": roll, "uav3.saving": saving}
        changed.append(replace(point, figures={**point.figures, **own}))
    path = tmp_path / "table.md"
    write_markdown(changed, 3, path)
    text = path.read_text()
    rows = [line for line in text.splitlines() if line.startswith("| surviving")]
    assert ["**9.00**" in row for row in rows] == [True, False]
    assert not any("**99.00 %**" in row for row in rows)  # of a saving more is better
    assert not {"**2.00**", "**5.00**"} & set(text.split())
    assert text.count("**Bold**") == 1
    assert "*: " in str(terminal_table(changed, 3).caption)


def test_a_lost_point_is_bold_and_never_the_better_one(short: Path, tmp_path: Path) -> None:
    points = swept([short], ["controller.kind=surviving,pid"], tmp_path / "out")
    for loser, marked in (("surviving", True), ("pid", False)):
        changed = [
            replace(one, outcome="ground", reason="it hit the ground")
            if one.values["controller.kind"] == loser
            else one
            for one in points
        ]
        path = tmp_path / f"{loser}.md"
        write_markdown(changed, 3, path)
        assert ("**ground**" in path.read_text()) == marked
        assert "**-**" not in path.read_text()

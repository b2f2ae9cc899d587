"""The tables and the plot of a sweep."""

import csv
from pathlib import Path

import pytest
from sweeping import flown

from gcs.errors import BadInput
from gcs.figures.sweep import draw_sweep
from gcs.reports.sweep import choose_uav, terminal_table, write_csv, write_markdown
from gcs.sweeps.axes import parse_axes
from gcs.sweeps.folder import open_folder, result_of
from gcs.sweeps.grid import plan


def test_the_uav_with_a_fault_is_shown_or_else_the_last(short: Path) -> None:
    axes = parse_axes(["faults=[{uav: 1, actuator: rudder, bias_deg: 1, start_s: 0}],[]"])
    faulted, healthy = plan([short], axes)
    assert choose_uav([healthy, faulted], None) == 1
    assert choose_uav([healthy], None) == 3
    assert choose_uav([healthy], 2) == 2
    with pytest.raises(BadInput, match="expected one of 1, 2, 3"):
        choose_uav([healthy], 9)


def test_report_has_every_run(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    stuck = "[{uav: 2, actuator: throttle, stuck_n: 2000, start_s: 0}]"
    axes = parse_axes(["trigger.b2_deg=0.5,1,-1", f"faults=[],{stuck}", "duration_s=0.05"])
    open_folder(folder, [short], axes)
    runs = plan([short], axes)
    by_digest = {result.run.digest: result for result in flown(runs[:4], folder)}
    results = [result_of(run, by_digest) for run in runs]
    write_csv(results, folder / "table.csv")
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 3 + 2
    assert [row["outcome"] for row in rows[-2:]] == ["invalid"] * 2
    uavs = [uav for result in results[:4] if result.summary for uav in result.summary.uavs]
    for row, uav in zip(rows[:-2], uavs, strict=True):
        assert float(row["iae_yaw_deg_s"]) == uav.iae["yaw"]
        assert (row["uav"], row["scenario"]) == (str(uav.id), str(short))
        assert int(row["events_rudder"]) == uav.channels["rudder"].events
    write_markdown(results, 3, folder / "table.md")
    assert (folder / "table.md").read_text().count("\n| ") == 1 + 1 + 6
    assert terminal_table(results, 3).row_count == 6
    draw_sweep(results, 3, folder)
    assert (folder / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "sweep.svg").read_text().startswith("<?xml")


def test_neighbour_messages_have_columns_where_a_trigger_is_swept(
    short: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    axes = parse_axes(["links.formation.trigger=null,{}", "duration_s=0.05"])
    open_folder(folder, [short], axes)
    runs = plan([short], axes)
    by_digest = {result.run.digest: result for result in flown(runs, folder)}
    results = [result_of(run, by_digest) for run in runs]
    write_csv(results, folder / "table.csv")
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["neighbour_messages"] for row in rows[:3]] == ["98", "49", "49"]
    assert [float(row["neighbour_saving"]) for row in rows[:3]] == [0.0] * 3
    assert all(0 < int(row["neighbour_messages"]) < 40 for row in rows[3:])
    write_markdown(results, 3, folder / "table.md")
    head, _, periodic, triggered = (folder / "table.md").read_text().splitlines()[2:]
    assert "| neighbour messages | neighbour messages saved |" in head
    assert "| 49 | 0.00 % |" in periodic
    assert "| 49 |" not in triggered
    assert len(terminal_table(results, 3).columns) == 2 + 1 + 4 + 1

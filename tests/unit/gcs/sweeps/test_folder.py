"""Folders of sweeps, and what is flown again."""

from pathlib import Path

import pytest
from sweeping import flown

from gcs.errors import BadInput
from gcs.sweeps.axes import parse_axes
from gcs.sweeps.folder import default_folder, open_folder
from gcs.sweeps.grid import plan


def test_folder_is_named_by_the_request(short: Path) -> None:
    axes = [parse_axes([text]) for text in ("k=1,2", "k=1, 2", "k=1,3", "l=1,2")]
    names = [default_folder([short], one) for one in axes]
    assert names[0] == names[1]
    assert len({*names, default_folder([short, short], axes[0])}) == 4
    assert names[0].parent == Path("runs")
    assert names[0].name.startswith("sweep-short-")


def test_folder_of_something_else_is_left_alone(tmp_path: Path, short: Path) -> None:
    (tmp_path / "precious").mkdir()
    with pytest.raises(BadInput, match="not a sweep"):
        open_folder(tmp_path, [short], [])
    assert not (tmp_path / "runs").exists()
    assert not (tmp_path / "sweep.json").exists()


def test_finished_runs_are_not_flown_again(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    axes = parse_axes(["trigger.b2_deg=0.5,1,2,4"])
    runs = plan([short], axes)
    open_folder(folder, [short], axes)
    first = flown(runs, folder)
    assert len(first) == 4
    files = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    assert len(files) == 4

    damaged, lost = sorted(files)[:2]
    damaged.write_text(damaged.read_text()[:100])
    lost.unlink()
    open_folder(folder, [short], axes)
    again = flown(runs, folder)
    assert {result.run.digest for result in again} == {damaged.stem, lost.stem}
    for path in sorted(files)[2:]:
        assert path.stat().st_mtime_ns == files[path]

    more = plan([short], parse_axes(["trigger.b2_deg=1,8"]))
    assert [result.run.values for result in flown(more, folder)] == [{"trigger.b2_deg": 8}]

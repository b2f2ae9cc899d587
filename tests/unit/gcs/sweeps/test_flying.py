"""Flying the runs of a sweep, several at a time."""

from pathlib import Path
from typing import Any

import pytest
from sweeping import flown

from gcs.sweeps import flying
from gcs.sweeps.axes import parse_axes
from gcs.sweeps.flying import fly_runs
from gcs.sweeps.folder import Result, known_results, open_folder
from gcs.sweeps.grid import plan


def test_results_do_not_depend_on_the_number_of_jobs(short: Path, tmp_path: Path) -> None:
    axes = parse_axes(["trigger.b2_deg=0.5,1,2,4"])
    seen = []
    for jobs in (1, 3):
        open_folder(tmp_path / str(jobs), [short], axes)
        runs = plan([short], axes)
        results = flown(runs, tmp_path / str(jobs), jobs)
        by_digest = {r.run.digest: r.summary.uavs for r in results if r.summary is not None}
        seen.append([by_digest[run.digest] for run in runs])
    assert seen[0] == seen[1]


def test_a_flight_that_cannot_be_computed_is_recorded_and_tried_again(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise ZeroDivisionError("by nothing")

    open_folder(tmp_path / "out", [short], [])
    runs = plan([short], [])
    with monkeypatch.context() as patch:
        patch.setattr(flying, "fly_in_process", broken)
        (failed,) = flown(runs, tmp_path / "out")
    assert (failed.outcome, failed.reason) == ("failed", "ZeroDivisionError: by nothing")
    assert isinstance(failed.defect, ZeroDivisionError)
    (result,) = flown(runs, tmp_path / "out")
    assert result.outcome == "completed"


def test_leaving_early_stops_the_flights_in_the_air(short: Path, tmp_path: Path) -> None:
    def leave(_: Result) -> None:
        raise KeyboardInterrupt

    runs = plan([short], parse_axes(["duration_s=0.05,60,61,62,63"]))
    open_folder(tmp_path / "out", [short], [])
    with pytest.raises(KeyboardInterrupt):
        fly_runs(runs, tmp_path / "out", 2, leave)
    assert list(known_results(runs, tmp_path / "out")) == [runs[0].digest]

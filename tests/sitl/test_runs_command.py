"""What `gcs runs` says of flights of real processes: under way, interrupted, killed."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest
from flying import SCENARIO_1, TIMEOUT_S, environment, fly_well, kill_all, run, start, wait_until

pytestmark = pytest.mark.sitl


def listed(root: Path) -> dict[str, dict[str, Any]]:
    done = run("gcs", "runs", "list", root, "--json")
    assert done.returncode == 0, done.stderr
    return {one["name"]: one for one in json.loads(done.stdout)["runs"]}


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_a_flight_is_under_way_until_it_ends(tmp_path: Path, end: signal.Signals) -> None:
    root = tmp_path / "runs"
    root.mkdir()
    folder = root / "real"
    arguments = ("fly", SCENARIO_1, "--speed", "1", "--free-ports", "--set", "trigger.b2_deg=2")
    popen = start("gcs", *arguments, "--out", folder, env=environment())
    try:
        trajectory = folder / "trajectory.arrows"
        wait_until(lambda: trajectory.exists() and trajectory.stat().st_size > 20_000, "steps")
        run_ = listed(root)["real"]
        assert (run_["outcome"], run_["kind"], run_["law"]) == ("under_way", "flight", "proposed")
        assert run_["changes"] == ["trigger.b2_deg=2"]
        assert run_["events"] > 0
        popen.send_signal(end)
        popen.wait(TIMEOUT_S)
    finally:
        kill_all(popen, folder)
    ended = listed(root)["real"]
    assert ended["outcome"] == ("interrupted" if end == signal.SIGINT else "killed")
    assert ended["duration_s"] >= run_["duration_s"]


def test_the_scenario_beside_a_flight_flies_it_again(tmp_path: Path) -> None:
    options = ("--in-process", "--no-figures", "--set", "duration_s=0.5")
    fly_well(SCENARIO_1, *options, "--with", "realistic", "--out", tmp_path / "first")
    fly_well(tmp_path / "first" / "scenario.yaml", *options[:2], "--out", tmp_path / "again")
    events = [(tmp_path / name / "events.arrows").read_bytes() for name in ("first", "again")]
    assert events[0] == events[1]
    done = run("gcs", "compare", tmp_path / "first", tmp_path / "again")
    assert done.returncode == 0, done.stderr
    assert "their scenarios are the same" in done.stdout
    found = listed(tmp_path)
    assert found["first"]["changes"] == ["with realistic", "duration_s=0.5"]
    assert found["first"]["events"] == found["again"]["events"]


def test_what_is_no_folder_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    for path in (file, tmp_path / "none"):
        for command in ("list", "html"):
            done = run("gcs", "runs", command, path)
            assert done.returncode == 2
            assert f"cannot list the runs in {path}" in done.stderr
            assert sorted(tmp_path.iterdir()) == [file]

"""An ArduPlane that ends in flight is started again: a peer, and a real one if it is named."""

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from flying import TIMEOUT_S, assert_one_message, start, summary_of, wait_until
from needs import ARDUPLANE
from test_foreign import children_of, flown, mixed, peer

pytestmark = pytest.mark.sitl

MISSION = {
    "items": [
        {"waypoint": {"north_m": 700.0 * n, "east_m": 300.0 * e, "height_m": 300.0}}
        for n, e in ((1, 0), (2, 0), (2, 1))
    ]
}


def restarted(folder: Path, scenario: Path) -> dict[str, Any]:
    """Fly with one that ends in flight; return the summary."""
    done = flown(folder, scenario, "--restart", "on-failure", "--record", "full")
    assert done.returncode == 0, done.stderr
    summary = summary_of(folder / "run")
    own: dict[str, Any] = summary["uavs"][2]
    assert (summary["completed"], own["restarts"], own["missing_steps"]) == (True, 1, 0)
    assert own["active_steps"] == summary["steps"]
    return own


def test_one_that_ends_in_flight_is_told_all_again(tmp_path: Path) -> None:
    heard = tmp_path / "heard"
    binary = peer(tmp_path, PEER_DIES_S="10", PEER_HEARD=str(heard))
    restarted(tmp_path, mixed(tmp_path, binary, duration_s=6.0, mission=MISSION))
    lines = heard.read_text().splitlines()
    log = (tmp_path / "run" / "processes" / "uav3.log").read_text()
    first = ["4 items", "mission", "armed"]
    assert lines == [*first, "4 items", "mode 10", "item 2", "armed"], log
    assert "ended with status 3 at " in log
    assert not children_of(binary)


def test_in_real_time_it_is_not_started_again(tmp_path: Path) -> None:
    binary = peer(tmp_path, PEER_DIES_S="9", PEER_HEARD=str(tmp_path / "heard"))
    scenario = mixed(tmp_path, binary, duration_s=30.0)
    done = flown(tmp_path, scenario, "--restart", "on-failure", "--speed", "1")
    assert (done.returncode, "ArduPlane ended with status 3 at" in done.stderr) == (1, True)
    assert "is started again in lockstep only" in done.stderr
    assert_one_message(done.stderr)
    assert not children_of(binary)


@pytest.mark.real_arduplane
def test_a_real_one_that_is_killed_is_started_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PEER_OF", str(tmp_path))
    scenario = mixed(tmp_path, ARDUPLANE, duration_s=20.0, mission=MISSION)
    options = ("--out", str(tmp_path / "run"), "--free-ports", "--restart", "on-failure")
    flight = start("gcs", "fly", str(scenario), *options, "--quiet")
    log = tmp_path / "run" / "processes" / "plant.log"
    wait_until(lambda: log.exists() and "all armed" in log.read_text(), "it flies")
    name = Path(ARDUPLANE).expanduser().resolve().name
    for one in children_of(str(tmp_path)):
        if Path(f"/proc/{one}/comm").read_text().strip() == name[:15]:
            os.kill(one, signal.SIGKILL)
    _, error = flight.communicate(timeout=TIMEOUT_S)
    assert flight.returncode == 0, error
    summary = summary_of(tmp_path / "run")
    assert (summary["completed"], summary["uavs"][2]["restarts"]) == (True, 1)

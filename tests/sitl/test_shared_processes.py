"""Several autopilots in one process: the same flight and messages, from fewer processes."""

import json
import os
import signal
from pathlib import Path

import pytest
from flying import (
    TIMEOUT_S,
    arrays_of,
    fly_well,
    flying,
    free_links,
    process_of,
    processes_of,
    run,
    standing,
    star_tree,
    write_scenario,
)

from gcs.scenario.model import Scenario

pytestmark = pytest.mark.sitl


@pytest.mark.parametrize(
    ("processes", "logs"),
    [
        ("3", ["uav1-uav3.log", "uav4-uav6.log", "uav7-uav10.log"]),
        ("1", ["uav1-uav10.log"]),
    ],
)
def test_a_flight_of_fewer_processes_is_the_same(
    tmp_path: Path, processes: str, logs: list[str]
) -> None:
    tree = star_tree(10, duration_s=0.3, wind={"turbulence": "moderate"})
    scenario = write_scenario(tmp_path, tree)
    shared, in_process = tmp_path / "shared", tmp_path / "in_process"
    options = ("--quiet", "--record=npz", "--out")
    fly_well(scenario, f"--autopilot-processes={processes}", "--free-ports", *options, shared)
    fly_well(scenario, "--in-process", *options, in_process)
    for name in ("events.npz", "trajectory.npz"):
        flown, expected = arrays_of(shared / name), arrays_of(in_process / name)
        assert flown.keys() == expected.keys()
        for key, array in flown.items():
            assert array.tobytes() == expected[key].tobytes(), key
    written = {path.name for path in (shared / "processes").glob("*.log")}
    assert written == {"plant.log", *logs}


def test_signed_messages_through_relays_are_counted_as_with_a_process_each(tmp_path: Path) -> None:
    assert run("gcs", "key", tmp_path / "key").returncode == 0
    relays = {"impairments": {"plant": {}, "formation": {}}, "signing_key": str(tmp_path / "key")}
    scenario = write_scenario(tmp_path, duration_s=0.5, links=free_links() | relays)
    counts = []
    for processes in ("1", "4"):  # of three
        folder = tmp_path / processes
        fly_well(scenario, f"--autopilot-processes={processes}", "--quiet", "--out", folder)
        summary = json.loads((folder / "summary.json").read_text())
        sent = [uav["neighbour_messages"] for uav in summary["uavs"]]
        assert sent == [998, 499, 499]
        counts.append([(uav["link_bytes"], uav["channels"]) for uav in summary["uavs"]])
    assert counts[0] == counts[1]


def test_when_a_process_dies_the_flight_is_lost_and_says_whose(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=2000.0)
    folder = tmp_path / "run"
    with flying(folder, scenario, "--autopilot-processes=2", "--record=none") as popen:
        os.kill(process_of(folder, "uav2"), signal.SIGKILL)
        _, text = popen.communicate(timeout=TIMEOUT_S)
    assert popen.returncode == 1
    assert "uav2-uav3: ended by signal 9" in text


def test_all_autopilots_of_a_process_stop_with_it(scenario1: Scenario, tmp_path: Path) -> None:
    with standing(scenario1, tmp_path, speed=None, autopilot_processes=1):
        assert len(processes_of(tmp_path)) == 2
    assert (tmp_path / "uav1-uav3.log").read_text() == ""


def test_none_in_a_process_is_refused(tmp_path: Path) -> None:
    options = ("--autopilot-processes", "0", "--out", tmp_path / "run")
    done = run("gcs", "fly", "paper/scenario1", *options)
    assert done.returncode == 2
    assert "--autopilot-processes" in done.stderr

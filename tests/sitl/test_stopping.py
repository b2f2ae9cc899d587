"""However a flight ends, it says why, keeps what was recorded, and leaves no process behind."""

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from random import Random

import numpy as np
import pytest
from flying import (
    BIN,
    TIMEOUT_S,
    assert_one_message,
    environment,
    fly_well,
    flying,
    kill_all,
    process_of,
    processes_of,
    run,
    table_of,
    wait_until,
    write_scenario,
)

pytestmark = pytest.mark.sitl


def message_at_end(popen: subprocess.Popen[str], exit_status: int) -> str:
    _, stderr = popen.communicate(timeout=TIMEOUT_S)
    assert popen.returncode == exit_status, stderr
    assert_one_message(stderr)
    return stderr


def assert_all_gone(folder: Path) -> None:
    wait_until(lambda: not processes_of(folder), "no process is left")


def assert_readable_log(folder: Path) -> None:
    done = run("mavlogdump.py", "--types", "COMMAND_ACK,MISSION_ITEM_INT", folder / "flight.tlog")
    assert done.returncode == 0, done.stderr
    assert "COMMAND_ACK" in done.stdout
    assert "MISSION_ITEM_INT" in done.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupt(tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / "run"
    with flying(folder, write_scenario(tmp_path), "--quiet", "--speed", "1") as popen:
        assert len(processes_of(folder)) == 5  # the ground station, the plant, three autopilots
        os.kill(popen.pid, number)
        message = message_at_end(popen, 128 + number)
        assert str(folder) in message
        assert not processes_of(folder)
    assert_readable_log(folder)
    plant = json.loads((folder / "processes" / "plant" / "end.json").read_text())
    assert plant["loss"] is None
    trajectory = table_of(folder / "trajectory.arrows")  # of all that was flown
    assert len(trajectory["time_s"]) == 3 * -(-plant["steps"] // 20)


def test_death_of_the_ground_station(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with flying(folder, write_scenario(tmp_path), "--quiet", "--speed", "1") as popen:
        assert len(processes_of(folder)) == 5
        os.kill(popen.pid, signal.SIGKILL)
        popen.communicate(timeout=TIMEOUT_S)
        assert popen.returncode == -signal.SIGKILL
        assert_all_gone(folder)
    # what the ground station had not written yet is lost, but the rest can be read
    assert run("mavlogdump.py", folder / "flight.tlog").returncode == 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGHUP, signal.SIGTERM])
@pytest.mark.parametrize("command", ["fly", "up"])
def test_death_of_the_ground_station_in_its_first_second(
    tmp_path: Path, command: str, number: signal.Signals
) -> None:
    """Whatever its processes are at just then: not started, importing, waiting."""
    random = Random(f"{command} {number}")
    folder = tmp_path / "run"
    log = folder / "processes" / random.choice(["plant.log", "uav1.log", "uav3.log"])
    popen = subprocess.Popen(
        [
            BIN / "gcs",
            command,
            write_scenario(tmp_path),
            "--quiet",
            "--free-ports",
            "--out",
            folder,
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait_until(log.exists, "it starts processes")
        time.sleep(random.uniform(0.0, 0.8))
        popen.send_signal(number)
        _, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert "Traceback" not in stderr
        assert_all_gone(folder)
    finally:
        kill_all(popen, folder)


def processes_marked(mark: str) -> list[int]:
    """Process ids of all that have inherited this from the environment of their command."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"MARK={mark}\0".encode() in (entry / "environ").read_bytes():
                found.append(int(entry.name))
    return found


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGHUP, signal.SIGTERM])
@pytest.mark.parametrize("command", ["fly", "up"])
def test_death_of_the_ground_station_before_it_knows_what_to_fly(
    tmp_path: Path, command: str, number: signal.Signals
) -> None:
    """The server that it starts ahead is still importing."""
    mark = f"{tmp_path}"
    popen = subprocess.Popen(
        [BIN / "gcs", command, write_scenario(tmp_path), "--free-ports", "--out", tmp_path / "run"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment(MARK=mark),
    )
    try:
        wait_until(lambda: len(processes_marked(mark)) == 2, "the server is started")
        popen.send_signal(number)
        popen.wait(timeout=TIMEOUT_S)
        wait_until(lambda: not processes_marked(mark), "no process is left")
        assert not (tmp_path / "run").exists()
    finally:
        kill_all(popen, tmp_path)


@pytest.mark.parametrize("mode", [(), ("--speed", "1")], ids=["lockstep", "real_time"])
def test_death_of_an_autopilot(tmp_path: Path, mode: tuple[str, ...]) -> None:
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=600.0)
    with flying(folder, scenario, "--quiet", *mode) as popen:
        os.kill(process_of(folder, "uav2"), signal.SIGKILL)
        message = message_at_end(popen, 1)
        assert set(re.findall(r"uav ?(\d+)", message.lower())) == {"2"}
        assert not processes_of(folder)
    assert_readable_log(folder)


@pytest.mark.parametrize("mode", [(), ("--speed", "1")], ids=["lockstep", "real_time"])
def test_death_of_the_plant(tmp_path: Path, mode: tuple[str, ...]) -> None:
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=600.0)
    with flying(folder, scenario, "--quiet", *mode) as popen:
        os.kill(process_of(folder, "plant"), signal.SIGKILL)
        message = message_at_end(popen, 1)
        assert "plant" in message
        assert not processes_of(folder)
    assert_readable_log(folder)


def test_what_was_flown_before_the_death_of_the_plant_is_kept_and_joined(tmp_path: Path) -> None:
    """States of the plant and signals of the autopilots, step by step as they were flown."""
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=600.0)
    with flying(folder, scenario, "--quiet") as popen:
        recording = folder / "trajectory.arrows"
        begun = recording.stat().st_size if recording.exists() else 0
        wait_until(lambda: recording.stat().st_size > max(begun, 50_000), "steps are recorded")
        os.kill(process_of(folder, "plant"), signal.SIGKILL)
        message_at_end(popen, 1)
    kept = table_of(folder / "trajectory.arrows")
    flown_s = float(kept["time_s"][-1])
    assert flown_s > 0.5
    shorter = write_scenario(tmp_path, duration_s=flown_s + 0.1)
    undisturbed = tmp_path / "undisturbed"
    fly_well(shorter, "--quiet", "--in-process", "--out", undisturbed)
    expected = table_of(undisturbed / "trajectory.arrows")
    for name, values in kept.items():
        assert np.array_equal(
            values, expected[name][: len(values)], equal_nan=values.dtype.kind == "f"
        ), name

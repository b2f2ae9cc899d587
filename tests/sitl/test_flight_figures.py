"""Figures are drawn by a process of their own, while the user reads the tables.

A figure of these tests is a named pipe: until somebody reads it, it is being written.
"""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from flying import (
    FIGURES,
    RESULTS,
    TIMEOUT_S,
    assert_one_message,
    environment,
    kill_all,
    processes_of,
    start,
    wait_until,
    write_scenario,
)

pytestmark = pytest.mark.sitl


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def drawing(tmp_path: Path, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A flight whose tables are printed, and whose first figure is not."""
    scenario = write_scenario(tmp_path, duration_s=2.0)
    arguments = ("--free-ports", "--speed", "1", "--out", folder)
    popen = start("gcs", "fly", scenario, *arguments, env=environment(FTC_SITL_NO_FIGURES="0"))
    try:
        wait_until((folder / "scenario.yaml").exists, "the run folder is there")
        os.mkfifo(folder / "flight.png")
        assert popen.stdout is not None
        printed = list(iter(popen.stdout.readline, f"results in {folder}\n"))
        assert any("Transmissions" in line for line in printed)
        yield popen
    finally:
        kill_all(popen, folder)


def test_tables_come_before_figures(drawing: subprocess.Popen[str], folder: Path) -> None:
    assert drawing.poll() is None
    assert (folder / "flight.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    _, errors = drawing.communicate(timeout=TIMEOUT_S)
    assert (drawing.returncode, errors) == (0, "")
    assert {path.name for path in folder.iterdir()} == RESULTS | FIGURES | {"processes"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_drawing_leaves_nothing_half_written(
    drawing: subprocess.Popen[str], folder: Path, number: signal.Signals
) -> None:
    os.kill(drawing.pid, number)
    _, errors = drawing.communicate(timeout=TIMEOUT_S)
    assert drawing.returncode == 128 + number
    assert_one_message(errors)
    assert {path.name for path in folder.iterdir()} == RESULTS | {"flight.png", "processes"}
    assert not processes_of(folder)


def test_death_of_the_ground_station_ends_the_drawing(
    drawing: subprocess.Popen[str], folder: Path
) -> None:
    assert len(processes_of(folder)) == 2
    os.kill(drawing.pid, signal.SIGKILL)
    wait_until(lambda: not processes_of(folder), "no process is left")

"""Autopilots forked from a warm process behave as processes of their own."""

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gcs.fleet.forked import Forked, ForkServer
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import free_ports

pytestmark = pytest.mark.slow  # each imports all that an autopilot needs

TIMEOUT_S = 120.0


@pytest.fixture
def server() -> Iterator[ForkServer]:
    server = ForkServer()
    yield server
    server.close()


def config_of(scenario: Scenario, folder: Path) -> Path:
    """Configuration of an autopilot whose plant is not there."""
    folder.mkdir(exist_ok=True)
    ports = free_ports(6, "127.0.0.1")
    update = {"gcs_port": ports[0], "plant_port": ports[1], "formation_base_port": ports[2]}
    links = scenario.links.model_copy(update=update)
    file = folder / "uav1.yaml"
    dump(scenario.model_copy(update={"links": links}).autopilot_config(1), file)
    return file


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def wait_until_started(server: ForkServer, *forked: Forked) -> None:
    while any(process.pid is None for process in forked):
        assert server.read(TIMEOUT_S)


def command_line(forked: Forked) -> list[str]:
    return Path(f"/proc/{forked.pid}/cmdline").read_bytes().decode().rstrip("\0").split("\0")


def test_status_and_log_are_those_of_the_process(server: ForkServer, tmp_path: Path) -> None:
    logs = [tmp_path / "a.log", tmp_path / "b.log"]
    forked = [server.start([str(tmp_path / "none.yaml")], log) for log in logs]
    with pytest.raises(subprocess.TimeoutExpired):
        forked[0].wait(0.0)
    assert [process.wait(TIMEOUT_S) for process in forked] == [2, 2]
    assert len({process.pid for process in forked}) == 2
    for log in logs:
        assert log.read_text() == f"{tmp_path / 'none.yaml'}: no such file\n"


def test_signals_reach_one_alone(server: ForkServer, tmp_path: Path, scenario1: Scenario) -> None:
    files = [config_of(scenario1, tmp_path / name) for name in "ab"]
    doomed, other = (server.start([str(file)], file.with_suffix(".log")) for file in files)
    wait_until_started(server, doomed, other)
    wait_until(lambda: command_line(other)[:2] == ["ftc-autopilot", str(files[1])])
    doomed.kill()
    assert doomed.wait(TIMEOUT_S) == -signal.SIGKILL
    assert other.poll() is None
    other.terminate()
    assert other.wait(TIMEOUT_S) in {0, -signal.SIGTERM}


def test_all_end_with_the_server(server: ForkServer, tmp_path: Path, scenario1: Scenario) -> None:
    forked = server.start([str(config_of(scenario1, tmp_path))], tmp_path / "log")
    wait_until_started(server, forked)
    server.close()
    assert forked.returncode is not None
    wait_until(lambda: not Path(f"/proc/{forked.pid}").exists())

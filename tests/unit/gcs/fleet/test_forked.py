"""Plant and autopilots forked from a warm process behave as processes of their own."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gcs.fleet.forked import Forked, ForkServer, start_alone, start_server_ahead
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import free_ports

pytestmark = pytest.mark.slow  # each imports all that an autopilot needs

TIMEOUT_S = 600.0


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


def pid_of(forked: Forked) -> int:
    assert forked.pid is not None
    return forked.pid


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def children() -> set[int]:
    """Process ids of what this process has started and not waited for."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {int(pid) for task in tasks for pid in task.read_text().split()}


def command_line(forked: Forked) -> list[str]:
    return Path(f"/proc/{forked.pid}/cmdline").read_bytes().decode().rstrip("\0").split("\0")


def test_status_and_log_come_from_the_process(server: ForkServer, tmp_path: Path) -> None:
    logs = [tmp_path / "a.log", tmp_path / "b.log"]
    forked = [server.start("ftc-autopilot", [str(tmp_path / "none.yaml")], log) for log in logs]
    with pytest.raises(subprocess.TimeoutExpired):
        forked[0].wait(0.0)
    assert [process.wait(TIMEOUT_S) for process in forked] == [2, 2]
    assert len({process.pid for process in forked}) == 2
    for log in logs:
        assert log.read_text() == f"{tmp_path / 'none.yaml'}: no such file\n"


@pytest.mark.parametrize("program", ["sitl-plant", "ftc-autopilot"])
def test_one_that_is_not_forked_is_the_same_program(program: str, tmp_path: Path) -> None:
    none, log = tmp_path / "none.yaml", tmp_path / "log"
    assert start_alone(program, [str(none)], log).wait(TIMEOUT_S) == 2
    assert log.read_text() == f"{none}: no such file\n"


def test_signals_reach_one_alone(server: ForkServer, tmp_path: Path, scenario1: Scenario) -> None:
    files = [config_of(scenario1, tmp_path / name) for name in "ab"]
    doomed, other = (
        server.start("ftc-autopilot", [str(file)], file.with_suffix(".log")) for file in files
    )
    wait_until_started(server, doomed, other)
    wait_until(lambda: command_line(other)[:2] == ["ftc-autopilot", str(files[1])])
    doomed.kill()
    assert doomed.wait(TIMEOUT_S) == -signal.SIGKILL
    assert other.poll() is None
    other.terminate()
    assert other.wait(TIMEOUT_S) in {0, -signal.SIGTERM}


def test_what_waits_for_others_is_started_when_it_is_waited_for(
    server: ForkServer, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    lonely = server.start("sitl-plant", ["nowhere.yaml"], log, more=True)
    assert lonely.wait(TIMEOUT_S) == 2, "no other comes, as one could not be started"


def test_those_that_are_started_together_fail_one_by_one(
    server: ForkServer, tmp_path: Path, scenario1: Scenario
) -> None:
    config, logs = config_of(scenario1, tmp_path), (tmp_path / "plant.log", tmp_path / "uav1.log")
    plant = server.start("sitl-plant", ["nowhere.yaml"], logs[0], more=True)
    autopilot = server.start("ftc-autopilot", [str(config)], logs[1])
    assert plant.wait(TIMEOUT_S) == 2
    assert "nowhere.yaml" in logs[0].read_text()
    wait_until_started(server, autopilot)
    assert autopilot.poll() is None
    autopilot.terminate()
    assert autopilot.wait(TIMEOUT_S) in {0, -signal.SIGTERM}


def test_all_end_with_the_server(server: ForkServer, tmp_path: Path, scenario1: Scenario) -> None:
    forked = server.start("ftc-autopilot", [str(config_of(scenario1, tmp_path))], tmp_path / "log")
    wait_until_started(server, forked)
    server.close()
    assert forked.returncode is not None
    wait_until(lambda: not Path(f"/proc/{forked.pid}").exists())


def test_plant_and_autopilots_are_in_one_session(
    server: ForkServer, tmp_path: Path, scenario1: Scenario
) -> None:
    """Linux divides the processors among sessions first."""
    uav = config_of(scenario1, tmp_path)
    plant = tmp_path / "plant.yaml"
    (port,) = free_ports(1, "127.0.0.1")
    links = scenario1.links.model_copy(update={"plant_port": port})
    dump(scenario1.model_copy(update={"links": links}).plant_config(None), plant)
    simulator = server.start("sitl-plant", [str(plant)], tmp_path / "plant.log")
    autopilot = server.start("ftc-autopilot", [str(uav)], tmp_path / "uav1.log")
    wait_until_started(server, simulator, autopilot)
    wait_until(lambda: command_line(simulator)[:2] == ["sitl-plant", str(plant)])
    (session,) = {os.getsid(pid_of(process)) for process in (simulator, autopilot)}
    assert session == parent_of(pid_of(simulator)) != os.getsid(0)


def test_a_server_started_ahead_is_used_once(tmp_path: Path, scenario1: Scenario) -> None:
    before = children()
    start_server_ahead()
    (ahead,) = children() - before
    parents = []
    for name in "ab":
        file = config_of(scenario1, tmp_path / name)
        server = ForkServer()
        forked = server.start("ftc-autopilot", [str(file)], file.with_suffix(".log"))
        wait_until_started(server, forked)
        parents.append(parent_of(pid_of(forked)))
        server.close()
    assert parents[0] == ahead
    assert parents[1] != ahead
    assert children() == before


def test_a_server_started_ahead_ends_with_who_did_not_use_it(tmp_path: Path) -> None:
    code = "from gcs.fleet.forked import start_server_ahead; start_server_ahead()"
    mark = {"MARK": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], env=os.environ | mark, check=True)
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            assert f"MARK={tmp_path}\0".encode() not in (entry / "environ").read_bytes()

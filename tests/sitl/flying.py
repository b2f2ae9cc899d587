"""Tools of the whole-process tests: scenario files, commands, processes that are left."""

import contextlib
import itertools
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import yaml
from warm import WarmCommand, can_be_warm

from gcs.fleet.ports import on_free_ports
from gcs.fleet.processes import FleetProcesses
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import PortTaken, UdpAddress, bind_udp

BIN = Path(sys.executable).parent
SCENARIO_1 = Path(__file__).parents[2] / "scenarios" / "paper" / "scenario1.yaml"
TIMEOUT_S = 600.0  # only a defect takes so long, on whatever machine
CHANNELS = ("throttle", "aileron", "elevator", "rudder")
_PORT_BLOCKS = itertools.count(random.randrange(60))
RESULTS = {"summary.json", "flight.tlog", "events.arrows", "trajectory.arrows"}
RESULTS |= {"flight.yaml", "scenario.yaml"}
FIGURES = {"flight.png", "flight.svg"}


def scenario_tree(**changes: Any) -> dict[str, Any]:
    """Scenario 1 as a tree, with top-level keys replaced."""
    tree: dict[str, Any] = yaml.safe_load(SCENARIO_1.read_text())
    return tree | changes


def hexagon_tree() -> dict[str, Any]:
    """The bundled mission in formation, as a tree."""
    tree: dict[str, Any] = yaml.safe_load((SCENARIOS / "missions" / "hexagon.yaml").read_text())
    return tree | {"extends": str(SCENARIO_1)}


def star_tree(uavs: int, **changes: Any) -> dict[str, Any]:
    """Scenario 1 without its fault and with more followers of the leader, keys replaced."""
    tree = scenario_tree(faults=[], **changes)
    follower, others = tree["uavs"][2], range(4, uavs + 1)
    tree["uavs"] += [{**follower, "id": i, "name": f"follower {i - 1}"} for i in others]
    tree["network"]["edges"] += [{"between": [1, i], "weight": 1.0} for i in others]
    return tree


def write_scenario(folder: Path, tree: dict[str, Any] | None = None, **changes: Any) -> Path:
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump((tree or scenario_tree()) | changes, sort_keys=False))
    return path


def free_links(uavs: int = 3) -> dict[str, Any]:
    """Return the links section of a scenario on free ports that no other test is given.

    They lie below the ports that `--free-ports` takes. Each worker of pytest-xdist has its own.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 8
    while True:
        first = 15_000 + 600 * worker + 10 * (next(_PORT_BLOCKS) % 60)
        gcs, plant, *formation = range(first, first + 2 + uavs)
        with contextlib.ExitStack() as sockets, contextlib.suppress(PortTaken):
            for port in (gcs, plant, *formation):
                sockets.enter_context(bind_udp(UdpAddress("127.0.0.1", port), "free port"))
            return {"gcs_port": gcs, "plant_port": plant, "formation_base_port": formation[0] - 1}


def environment(**changes: str) -> dict[str, str]:
    """The environment of a command: without figures, which take as long as many a flight.

    Bytecode is only read: on a full disk Python would write half of it, and read that later.
    """
    ours = {"COLUMNS": "1000", "NO_COLOR": "1", "FTC_SITL_NO_FIGURES": "1"}
    return os.environ | ours | {"PYTHONDONTWRITEBYTECODE": "1"} | changes


def run(
    program: str,
    *arguments: str | Path,
    env: dict[str, str] | None = None,
    cwd: Path | None = None,
    timeout_s: float = TIMEOUT_S,
    file_size: int = resource.RLIM_INFINITY,
) -> subprocess.CompletedProcess[str]:
    """Run one of the console scripts to its end, with files no larger than a size [bytes]."""
    popen = start(program, *arguments, env=env, cwd=cwd, file_size=file_size)
    try:
        texts = popen.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        popen.kill()
        raise
    assert popen.returncode is not None
    return subprocess.CompletedProcess([program, *arguments], popen.returncode, *texts)


def start(
    program: str,
    *arguments: str | Path,
    env: dict[str, str] | None = None,
    cwd: Path | None = None,
    output: Path | None = None,
    file_size: int = resource.RLIM_INFINITY,
) -> subprocess.Popen[str]:
    """Start one of the console scripts; its standard output goes to a pipe, or to a file."""
    env = env or environment()
    if program == "gcs" and can_be_warm(env):
        given = [str(argument) for argument in arguments]
        return cast("subprocess.Popen[str]", WarmCommand(given, env, cwd, output, file_size))
    with output.open("w") if output else contextlib.nullcontext() as file:
        return subprocess.Popen(
            [BIN / program, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=file or subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=env,
            cwd=cwd,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size)),  # noqa: PLW1509 - no thread holds a lock here
        )


def fly(*arguments: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    return run("gcs", "fly", *arguments, env=environment(**changes))


def fly_well(*arguments: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    done = fly(*arguments, **changes)
    assert done.returncode == 0, done.stderr
    return done


def summary_of(folder: Path) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    return summary


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as arrays:
        return dict(arrays)


def table_of(path: Path) -> dict[str, np.ndarray]:
    """The columns of a recording, as any reader of Arrow streams gives them."""
    table = pa.ipc.open_stream(path.read_bytes()).read_all()
    return {name: table[name].to_numpy() for name in table.column_names}


def recorded_by(folder: Path) -> np.ndarray:
    """All rows that a process has recorded into its folder."""
    return np.concatenate([np.load(path) for path in sorted(folder.glob("*.npy"))])


def processes_of(folder: Path) -> dict[int, str]:
    """Processes with this folder, or one of its files, on their command line, by process id."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            command = (entry / "cmdline").read_bytes().decode(errors="replace")
            state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
            paths = command.split("\0")
            ours = any(path == str(folder) or path.startswith(f"{folder}/") for path in paths)
            if ours and state != "Z":
                found[int(entry.name)] = command.replace("\0", " ")
    return found


def process_of(folder: Path, name: str) -> int:
    """Process id of "plant" or "uav3" of a run."""
    config = f"{folder / 'processes' / name}.yaml"
    (pid,) = [pid for pid, command in processes_of(folder).items() if config in command]
    return pid


def wait_until(condition: Callable[[], bool], what: str, timeout_s: float = TIMEOUT_S) -> None:
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"waited {timeout_s:g} s for this in vain: {what}"
        time.sleep(0.02)


def assert_one_message(text: str) -> None:
    """There is something on standard error, and it is meant for people."""
    assert text.strip()
    assert "Traceback" not in text
    assert "defect of ftc-sitl" not in text


@contextlib.contextmanager
def standing(
    scenario: Scenario, folder: Path, speed: float | None = 1.0, **options: Any
) -> Iterator[Scenario]:
    """The processes of a scenario on free ports, waiting; none of them is left.

    They fly in real time, or in lockstep if there is no speed.
    """

    def start(scenario: Scenario, _: UdpAddress) -> tuple[Scenario, contextlib.ExitStack]:
        links = scenario.links
        ports = {links.plant_port, *(links.formation_base_port + uav.id for uav in scenario.uavs)}
        with contextlib.ExitStack() as stack:
            fleet = stack.enter_context(
                FleetProcesses(scenario, speed=speed, folder=folder, **options)
            )

            def up() -> bool:
                fleet.check()
                return ports <= bound_ports()

            wait_until(up, "all ports are bound")
            return scenario, stack.pop_all()

    started, stack = on_free_ports(scenario, start)
    with stack:
        yield started
    assert not processes_of(folder)


def bound_ports() -> set[int]:
    """The UDP ports of this machine that are bound (Linux)."""
    rows = Path("/proc/net/udp").read_text().splitlines()[1:]
    return {int(row.split()[1].split(":")[1], 16) for row in rows}


@contextlib.contextmanager
def flying(folder: Path, *arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """``gcs fly --out folder`` in mid-flight; whatever is left of it in the end is killed."""
    popen = start("gcs", "fly", *arguments, "--free-ports", "--out", folder)
    log = folder / "processes" / "plant.log"

    def begun() -> bool:
        assert popen.poll() is None, popen.communicate()
        return log.exists() and "simulated time starts" in log.read_text()

    try:
        wait_until(begun, "simulated time starts")
        yield popen
    finally:
        kill_all(popen, folder)


def kill_all(popen: subprocess.Popen[str], folder: Path) -> None:
    """Kill a ground station and whatever is left of its processes."""
    for pid in {popen.pid, *processes_of(folder)}:
        with contextlib.suppress(ProcessLookupError):
            if pid != popen.pid or popen.returncode is None:
                os.kill(pid, signal.SIGKILL)
    popen.communicate(timeout=TIMEOUT_S)

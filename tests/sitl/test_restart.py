"""Killed and started again by hand: an autopilot in flight, and the plant itself."""

import asyncio
import contextlib
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from flying import free_links, recorded_by

from gcs.fleet.forked import FORKS, Forked, ForkServer, start_alone
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import Connection, UdpAddress

pytestmark = pytest.mark.sitl
PATIENCE_S = 600.0
WAITING = "waiting for it to come back"
STARTS = "simulated time starts"


class Processes:
    """Plant and autopilots of a scenario, each with its own log; forked where that is possible."""

    def __init__(self, scenario: Scenario, folder: Path, server: ForkServer) -> None:
        self.scenario, self._folder, self._server = scenario, folder, server
        self._running: dict[str, subprocess.Popen[bytes] | Forked] = {}

    def start_plant(self, **changes: object) -> None:
        config = self.scenario.plant_config().model_copy(update=changes)
        dump(config, self._folder / "plant.yaml")
        self._start("plant", "sitl-plant", record=config.duration_s is not None)

    def start_autopilot(self, uav: int, **changes: object) -> None:
        config = self.scenario.autopilot_config(uav).model_copy(update=changes)
        dump(config, self._folder / f"uav{uav}.yaml")
        self._start(f"uav{uav}", "ftc-autopilot", record=True)

    def log(self, name: str) -> str:
        return (self._folder / f"{name}.log").read_text()

    def record(self, name: str) -> np.ndarray:
        return recorded_by(self._folder / name)

    def kill(self, name: str) -> None:
        self._running[name].kill()
        self._running.pop(name).wait(PATIENCE_S)

    def end(self, name: str, ask: bool = False) -> int:
        """Exit status of a process that ends by itself, or when asked to."""
        if ask:
            self._running[name].terminate()
        return self._running[name].wait(PATIENCE_S)

    def kill_all(self) -> None:
        for name in list(self._running):
            self.kill(name)

    def _start(self, name: str, program: str, record: bool) -> None:
        arguments = [str(self._folder / f"{name}.yaml")]
        if record:
            arguments += ["--record", str(self._folder / name)]
        log = self._folder / f"{name}.log"
        start = self._server.start if FORKS else start_alone
        self._running[name] = start(program, arguments, log)


@pytest.fixture(scope="module")
def server() -> Iterator[ForkServer]:
    server = ForkServer()
    yield server
    server.close()


@contextlib.contextmanager
def processes_of(scenario: Scenario, folder: Path, server: ForkServer) -> Iterator[Processes]:
    processes = Processes(scenario, folder, server)
    try:
        yield processes
    finally:
        processes.kill_all()


def station(scenario: Scenario) -> Client:
    address = UdpAddress(scenario.links.host, scenario.links.gcs_port)
    return Client(Connection("in", address), private=True)


def simulated_ms(client: Client, uav: int) -> int:
    return round(1e3 * (client.vehicle(uav).state.time_s or 0.0))


def has_text(vehicle: Vehicle, part: str) -> bool:
    return any(part in text.text for text in vehicle.state.texts)


async def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


@pytest.fixture
def scenario(scenario1: Scenario) -> Scenario:
    """Scenario 1 on ports of its own, for two seconds and without faults."""
    links = scenario1.links.model_copy(update=free_links(len(scenario1.uavs)))
    return scenario1.model_copy(update={"links": links, "duration_s": 2.0, "faults": ()})


def test_an_autopilot_that_was_started_again_flies_on(
    scenario: Scenario, tmp_path: Path, server: ForkServer
) -> None:
    """The plant waits for it, and holds the last command.

    High up: until it is armed again nobody flies, however long a busy machine takes for that.
    """
    uav = scenario.uavs[0]
    high = uav.model_copy(update={"initial": uav.initial.model_copy(update={"altitude_m": 9e3})})
    alone = scenario.model_copy(update={"uavs": (high,)})

    async def fly(processes: Processes) -> None:
        async with station(alone) as client:
            processes.start_autopilot(1, neighbours=())
            await client.wait_for([1], PATIENCE_S)
            await client.vehicle(1).arm()
            await until(lambda: simulated_ms(client, 1) > 1000)
            latest = client.vehicle(1).state.latest
            await until(lambda: dialect.MAVLINK_MSG_ID_FTC_EVENTS in latest)
            events = latest.pop(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
            assert events.get_srcSystem() == 1
            processes.kill("uav1")
            await until(lambda: processes.log("plant").rstrip().endswith(WAITING))
            held_ms = simulated_ms(client, 1)
            processes.start_autopilot(1, neighbours=())
            await until(lambda: simulated_ms(client, 1) > held_ms + 1000)
            await until(lambda: client.vehicle(1).state.tells_private)
            await client.vehicle(1).arm()

    with processes_of(alone, tmp_path, server) as processes:
        processes.start_plant(wait_for_restart=True, silence_timeout_s=0.5, duration_s=None)
        asyncio.run(fly(processes))
        assert processes.end("plant", ask=True) == 0
        assert processes.end("uav1") == 0
        assert "is back at" in processes.log("plant").rpartition(WAITING)[2]


@pytest.mark.parametrize("speed", [None, 1.0])
def test_a_plant_that_was_started_again_flies_only_when_all_are_armed_again(
    scenario: Scenario, tmp_path: Path, server: ForkServer, speed: float | None
) -> None:
    ids = [uav.id for uav in scenario.uavs]
    steps = round(scenario.duration_s * 1e6 / scenario.step_us)

    async def fly(processes: Processes) -> None:
        async with station(scenario) as client:
            for i in ids:
                processes.start_autopilot(i, silence_timeout_s=PATIENCE_S)
            await client.wait_for(ids, PATIENCE_S)
            vehicles = [client.vehicle(i) for i in ids]
            for vehicle in vehicles:
                await vehicle.upload_profile(scenario.segments())
                await vehicle.start_mission()
                await vehicle.arm()
            await until(lambda: all(simulated_ms(client, i) > 1000 for i in ids))
            processes.kill("plant")
            processes.start_plant(speed=speed)
            await until(lambda: not any(v.state.armed for v in vehicles))
            for vehicle in vehicles:
                await until(partial(has_text, vehicle, "plant restarted"))
                await vehicle.start_mission()
            for vehicle in vehicles[1:]:
                await vehicle.arm()
            assert processes.log("plant").count(STARTS) == 1
            await vehicles[0].arm()
            await until(lambda: processes.log("plant").count(STARTS) == 2)
            assert all(processes.end(f"uav{i}") == 0 for i in ids)
        assert processes.end("plant") == 0

    with processes_of(scenario, tmp_path, server) as processes:
        processes.start_plant(speed=speed, duration_s=None)
        asyncio.run(fly(processes))
        flown = [processes.record(f"uav{i}")["signals"] for i in ids]
        states = processes.record("plant")["states"]
    assert len(states) == steps
    for signals in flown:
        assert signals["events"][0] == 0b1111  # the first step of a controller
    if speed is None:
        fresh = fly_in_process(scenario)
        assert np.array_equal(states, fresh.states)
        for k, signals in enumerate(flown):
            assert signals.tobytes() == np.ascontiguousarray(fresh.signals[:, k]).tobytes()

"""A plant that waits for an autopilot to be restarted holds the command and flies on with it."""

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gcs.client import Client
from gcs.launcher import on_free_ports
from gcs.scenario import Scenario
from mavlink_defs import dialect
from mavlink_defs.config import dump
from mavlink_defs.endpoint import Address, Connection

pytestmark = pytest.mark.sitl
PATIENCE_S = 60.0


def start(module: str, config: Path, log: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-c", f"from {module} import main; main()", str(config),
               "--exit-with-parent", str(os.getpid())]  # fmt: skip
    with log.open("ab") as output:
        return subprocess.Popen(command, stdout=output, stderr=output)


async def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


async def fly_with_a_restart(scenario: Scenario, folder: Path) -> None:
    plant_file, uav_file, log = folder / "plant.yaml", folder / "uav.yaml", folder / "log"
    config = scenario.plant_config(speed=None)
    changes = {"wait_for_restart": True, "silence_timeout_s": 2.0, "uavs": config.uavs[:1],
               "duration_s": None}  # fmt: skip
    dump(config.model_copy(update=changes), plant_file)
    dump(scenario.autopilot_config(1).model_copy(update={"neighbours": ()}), uav_file)
    processes = [start("sitl_plant.process", plant_file, log)]
    try:
        address = Address(scenario.links.host, scenario.links.gcs_port)
        async with Client(Connection("in", address)) as client:

            def simulated_ms() -> int:
                message = client.vehicle(1).state.latest.get(dialect.MAVLINK_MSG_ID_SYSTEM_TIME)
                return 0 if message is None else int(message.time_boot_ms)

            processes.append(start("ftc_autopilot.process", uav_file, log))
            await client.wait_for([1], PATIENCE_S)
            await client.vehicle(1).command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
            await until(lambda: simulated_ms() > 1000)
            told = len(log.read_text())
            processes[1].kill()
            processes[1].wait()
            await until(lambda: "waiting for it to come back" in log.read_text()[told:])
            held_ms = simulated_ms()
            processes.append(start("ftc_autopilot.process", uav_file, log))
            await until(lambda: simulated_ms() > held_ms + 1000)
            await client.vehicle(1).command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
        processes[0].terminate()
        assert processes[0].wait(PATIENCE_S) == 0
        assert processes[2].wait(PATIENCE_S) == 0
        assert "is back at" in log.read_text()
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_restarted_autopilot_is_taken_up_again(scenario1: Scenario, tmp_path: Path) -> None:
    on_free_ports(scenario1, lambda on, _: asyncio.run(fly_with_a_restart(on, tmp_path)))

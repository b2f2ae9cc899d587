"""An autopilot, or a plant, without processor time for a while: no healthy actuator is blamed."""

import os
import signal
import time
from pathlib import Path

import pytest
from flying import TIMEOUT_S, flying, process_of, summary_of, write_scenario

pytestmark = pytest.mark.sitl

STALLS_S = (0.1, 0.3, 0.15, 0.6)
APART_S = 0.5


@pytest.mark.parametrize(
    ("law", "speed", "stopped"),
    [("surviving", "1", "uav2"), ("tube", "0.5", "uav2"), ("surviving", "1", "plant")],
)
def test_stalls_blame_no_actuator(law: str, speed: str, stopped: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    trigger = {"mode": "consequence" if law == "tube" else "per_channel"}
    scenario = write_scenario(
        tmp_path, duration_s=5.0, faults=[], controller={"kind": law}, trigger=trigger
    )
    with flying(folder, scenario, "--quiet", "--speed", speed) as popen:
        pid = process_of(folder, stopped)
        time.sleep(1.0 / float(speed))
        for stall_s in STALLS_S:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(stall_s / float(speed))
            os.kill(pid, signal.SIGCONT)
            time.sleep(APART_S / float(speed))
        _, stderr = popen.communicate(timeout=TIMEOUT_S)
    assert popen.returncode == 0, stderr
    uavs = summary_of(folder)["uavs"]
    assert [uav["false_alarms"] for uav in uavs] == [0, 0, 0]
    if stopped == "plant":  # it goes on where it was
        return
    assert uavs[1]["active_steps"] < 5000 - 1000 * sum(STALLS_S) / 2  # it did stand still

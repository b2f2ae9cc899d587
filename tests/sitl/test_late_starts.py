"""An autopilot that is late at its start: the fleet flies on, and no row is of another step."""

import contextlib
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    TIMEOUT_S,
    assert_one_message,
    kill_all,
    process_of,
    processes_of,
    scenario_tree,
    start,
    table_of,
    wait_until,
    write_scenario,
)
from station import up

from gcs.results.store import TRAJECTORY
from mavlink_defs.endpoint import free_ports

pytestmark = pytest.mark.sitl

# When it is stopped, and for how long, in simulated time [s]. Held where the first steps of its
# controller put them, its surfaces turn it over: some flights are lost in the sixth second, none
# before it.
CASES = [(0.0, 3.0)]
if swept := os.environ.get("FTC_SITL_LATE_STARTS"):  # all of the first seconds, by hand
    CASES = [(at, length) for at in range(int(swept)) for length in (0.2, 1.0, 3.0, 6.0, 10.0)]
SAME_M_S = 1e-6
CLIMB = [
    {"start_s": 0.0, "airspeed_m_s": 40.0, "roll_deg": 0.0, "pitch_deg": 1.0, "yaw_deg": 0.0},
    {"start_s": 0.2, "airspeed_m_s": 60.0, "roll_deg": 0.0, "pitch_deg": 1.0, "yaw_deg": 0.0}
    | {"shape": "ramp"},
    {"start_s": 40.0, "airspeed_m_s": 60.0, "roll_deg": 0.0, "pitch_deg": 1.0, "yaw_deg": 0.0},
]
LATE = re.compile(r"recording: (\d+) rows of uav(\d) are missing.* from ([\d.]+) to ([\d.]+) s")


def newest_s(folder: Path) -> float:
    """Return up to which simulated time there is a recording [s]."""
    with contextlib.suppress(Exception):  # its schema is being written
        return float(table_of(folder / TRAJECTORY)["time_s"][-1])
    return 0.0


def check_rows(folder: Path, said: str) -> None:
    """Rows are of the steps of their times, or missing; what came too late is told.

    An autopilot measures the true state, so that its airspeed says of which step its row is: but
    for the few steps at which it acts on what it predicts from an old state.
    """
    table = table_of(folder / TRAJECTORY)
    told = {int(uav): (float(first), float(last)) for _, uav, first, last in LATE.findall(said)}
    air = [table[name] - table[f"wind_{name}"] for name in "uvw"]
    true = np.sqrt(sum(each**2 for each in air))
    for uav in (1, 2, 3):
        mine = table["uav"] == uav
        times, own = table["time_s"][mine], table["V"][mine]
        there = ~np.isnan(own)
        assert np.allclose(np.diff(times), 0.02), "no step is left out"
        assert there.sum() > 20
        assert np.mean(np.abs(own - true[mine])[there] < SAME_M_S) > 0.9
        if uav in told:
            first, last = told[uav]
            assert np.isnan(own[(times >= first) & (times <= last)]).any()


def high_tree(**changes: Any) -> dict[str, Any]:
    """Scenario 1, high enough for nobody to steer for a while."""
    tree = scenario_tree(**changes)
    for uav in tree["uavs"]:
        uav["initial"]["altitude_m"] = 3000.0
    return tree


@pytest.mark.parametrize(("stopped_s", "for_s"), CASES)
def test_rows_are_of_their_steps_and_the_fleet_flies_on(
    tmp_path: Path, stopped_s: float, for_s: float
) -> None:
    """An autopilot gets no time at its start, as on a busy machine."""
    (hub,) = free_ports(1)
    tree = high_tree(profile=CLIMB, faults=[])
    options = ("--start", "--speed", "2", "--hub-port", str(hub), "--restart", "never")
    with up(tmp_path / "fleet", *options, tree=tree) as fleet:
        assert fleet.hub.endswith(f":{hub}"), "the port is honoured beside --free-ports"
        pid = process_of(fleet.folder, "uav2")
        wait_until(lambda: newest_s(fleet.folder) >= stopped_s, "it is stopped")
        os.kill(pid, signal.SIGSTOP)
        time.sleep(for_s / 2.0)  # at twice real time
        os.kill(pid, signal.SIGCONT)
        until_s = newest_s(fleet.folder) + 7.0

        def is_recorded() -> bool:
            assert fleet.popen.poll() is None, fleet.popen.communicate()
            return newest_s(fleet.folder) > until_s

        wait_until(is_recorded, "it is recorded")
        status, said = fleet.stop()
    assert status == 0, said
    assert "defect" not in said
    assert "recording ended" not in said
    check_rows(fleet.folder, said)


@pytest.mark.parametrize("restart", ["never", "on-failure"])
def test_an_autopilot_that_stands_still_while_it_is_prepared_is_waited_for(
    tmp_path: Path, restart: str
) -> None:
    """For longer than an upload is repeated; and one that has ended is told with its reason.

    On a busy machine it may be stopped after its start: it flies slowly, and high.
    """
    options = ("--json", "--free-ports", "--start", "--speed", "0.2", "--restart", restart)
    scenario = write_scenario(tmp_path, high_tree())
    popen = start("gcs", "up", scenario, "--out", tmp_path / "run", *options)
    try:
        wait_until(lambda: f"{tmp_path}/run/processes/uav2.yaml" in commands(tmp_path), "it is")
        pid = process_of(tmp_path / "run", "uav2")
        os.kill(pid, signal.SIGSTOP)
        time.sleep(12.0)
        assert popen.poll() is None, popen.communicate()
        if restart == "never":
            os.kill(pid, signal.SIGKILL)
            _, said = popen.communicate(timeout=TIMEOUT_S)
            assert popen.returncode == 1
            assert_one_message(said)
            assert "uav2: ended by signal 9" in said
        else:
            os.kill(pid, signal.SIGCONT)
            assert popen.stdout is not None
            assert popen.stdout.readline().startswith("{")
    finally:
        kill_all(popen, tmp_path / "run")


def commands(folder: Path) -> str:
    return " ".join(processes_of(folder / "run" / "processes").values())

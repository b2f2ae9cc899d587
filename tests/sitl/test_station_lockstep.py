"""Lockstep events are the same as in one process, whatever becomes of ground stations."""

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import TIMEOUT_S, arrays_of, flying, processes_of, wait_until, write_scenario
from station import ACCEPTED, ALL, up

from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import event_table
from gcs.scenario.model import Scenario
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl

FLOWN_S = 12.0  # of scenario 1 in a test; it is made for 24 s


@pytest.fixture(scope="module")
def reference(scenario1: Scenario) -> dict[str, np.ndarray]:
    """Events of scenario 1, flown in one process."""
    return event_table(fly_in_process(scenario1))


def test_stopped_and_killed_ground_stations_change_nothing(
    tmp_path: Path, reference: dict[str, np.ndarray]
) -> None:
    """Lockstep events are the same as in one process, whatever becomes of stations."""
    with up(tmp_path, "--lockstep", "--set", "links.telemetry_clock=simulated") as fleet:
        log = tmp_path / "events.tlog"
        direct = f"udpin:127.0.0.1:{fleet.gcs_port}"
        stations = [
            fleet.begin("status", "--watch", "--json", connect=direct),
            fleet.begin("status", "--watch", "--json"),
            fleet.begin("status", "--watch", "--json"),
            fleet.begin("record", log),
        ]
        frozen, doomed, watch, recorder = stations
        try:
            for station in (frozen, doomed, watch):
                assert station.stdout is not None
                assert station.stdout.readline()
            wait_until(lambda: log.exists() and log.stat().st_size > 0, "recording begins")
            assert fleet.gcs("start", *ALL).returncode == ACCEPTED
            assert fleet.gcs("arm", *ALL).returncode == ACCEPTED
            frozen.send_signal(signal.SIGSTOP)
            doomed.kill()
            assert watch.stdout is not None
            for line in watch.stdout:
                times_s = [state["time_s"] or 0.0 for state in json.loads(line)["vehicles"]]
                if len(times_s) == 3 and min(times_s) > FLOWN_S:
                    break
            recorder.send_signal(signal.SIGINT)
            assert recorder.wait(TIMEOUT_S) == 0
            status, said = fleet.stop(signal.SIGTERM)
            lines = [line for line in said.splitlines() if "recording hangs" not in line]
            assert (status, lines) == (0, [])  # on a busy machine the recorder gets no time
            assert not processes_of(fleet.folder)
        finally:
            for station in stations:
                station.kill()
                station.communicate()
    compare_events(log, reference)


def compare_events(log: Path, reference: dict[str, np.ndarray]) -> None:
    compared = {1: 0, 2: 0, 3: 0}
    message: Any
    for _, message in read_tlog(log):
        if message.get_type() == "FTC_EVENTS" and 0 < message.steps <= 1000 * FLOWN_S:
            uav = message.get_srcSystem()
            so_far = (reference["uav"] == uav) & (reference["step"] < message.steps)
            expected = [int((reference["channel"][so_far] == c).sum()) for c in range(4)]
            assert message.events == expected, (uav, message.steps)
            compared[uav] += 1
    assert min(compared.values()) > 30


def test_a_stopped_flight_goes_on_the_same(
    tmp_path: Path, reference: dict[str, np.ndarray]
) -> None:
    """`gcs fly` itself is stopped in mid-flight."""
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=FLOWN_S)
    with flying(folder, scenario, "--quiet", "--record=npz") as popen:
        os.kill(popen.pid, signal.SIGSTOP)
        end = folder / "processes" / "uav1" / "end.json"
        wait_until(end.exists, "the fleet has flown to its end")
        os.kill(popen.pid, signal.SIGCONT)
        _, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert popen.returncode == 0, stderr
    flown = arrays_of(folder / "events.npz")
    assert flown.keys() == reference.keys()
    early = reference["step"] < 1000 * FLOWN_S
    for name, values in reference.items():
        assert np.array_equal(flown[name], values[early]), name

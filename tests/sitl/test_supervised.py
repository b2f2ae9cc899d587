"""Autopilots that die are started again and resume their flight."""

import itertools
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from flying import (
    TIMEOUT_S,
    arrays_of,
    fly_well,
    flying,
    process_of,
    processes_of,
    summary_of,
    wait_until,
    write_scenario,
)
from station import state_of, status_when, up

from ftc_autopilot.config import AutopilotConfig
from gcs.fleet.flight import fly_and_record
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import read_tlog
from mavlink_defs.constants import ACTUATORS

pytestmark = pytest.mark.sitl
DIES_AT, AWAY = 400, 1000  # steps
DURATION_S = 4.0
SILENCE_S = 1.2 * AutopilotConfig.model_fields["silence_timeout_s"].default


def flown(scenario: Scenario, folder: Path) -> Recording:
    folder.mkdir()
    return fly_and_record(scenario, folder, restart=True, crashes={2: [DIES_AT]})


@pytest.mark.parametrize("navigation", ["true_state", "estimated"])
def test_in_lockstep_a_restart_is_the_same_in_every_run(
    scenario1: Scenario, tmp_path: Path, navigation: str
) -> None:
    """The estimate is resumed with the rest, and goes on while the law pauses."""
    keys = {"duration_s": 1.6, "faults": (), "navigation": navigation}
    scenario = scenario1.model_copy(update=keys)
    first, second = (flown(scenario, tmp_path / name) for name in ("first", "second"))
    assert first.restarts == second.restarts == (0, 1, 0)
    assert np.array_equal(first.states, second.states)
    assert first.signals.tobytes() == second.signals.tobytes()
    undisturbed = fly_in_process(scenario)
    until = slice(0, DIES_AT + 1)
    assert np.array_equal(first.states[until], undisturbed.states[until])
    assert first.signals[until].tobytes() == undisturbed.signals[until].tobytes()
    assert not np.array_equal(first.states, undisturbed.states)

    missing = np.flatnonzero(first.missing[:, 1])
    assert (missing == np.arange(DIES_AT + 1, DIES_AT + 1 + AWAY)).all()
    held = first.applied[missing[2:], 1]
    assert (held == held[0]).all()  # the aircraft holds its last command
    count_events_of_both_lives(first, scenario, tmp_path / "first")


def count_events_of_both_lives(flight: Recording, scenario: Scenario, folder: Path) -> None:
    """The autopilots' own counters, as a ground station hears them, agree with the recording."""
    reported, texts = {}, {1: "", 2: "", 3: ""}
    for _, message in read_tlog(folder / "flight.tlog"):
        if isinstance(message, dialect.MAVLink_ftc_events_message):
            reported[message.get_srcSystem()] = message
        if isinstance(message, dialect.MAVLink_statustext_message):
            texts[message.get_srcSystem()] += message.text
    for uav in summarise(flight, scenario).uavs:
        assert reported[uav.id].steps == uav.active_steps
        assert list(reported[uav.id].events) == [uav.channels[name].events for name in ACTUATORS]
        assert reported[uav.id].messages == uav.actuator_messages
        assert uav.restarts == int(uav.id == 2)
    assert "the flight of 0.400 s" in texts[2]
    assert "silent, edge dropped" in texts[1]
    assert "heard again, edge restored" in texts[1]


def test_a_plant_that_stands_still_for_longer_than_autopilots_wait_is_waited_for(
    tmp_path: Path,
) -> None:
    """Nobody gives up while somebody supervises: the flight goes on as if nothing had been."""
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=DURATION_S, faults=[])
    options = ("--quiet", "--restart", "on-failure", "--record", "npz")
    with flying(folder, scenario, *options) as popen:
        plant = process_of(folder, "plant")
        os.kill(plant, signal.SIGSTOP)
        time.sleep(SILENCE_S)
        os.kill(plant, signal.SIGCONT)
        _, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert popen.returncode == 0, stderr
    assert all(uav["restarts"] == 0 for uav in summary_of(folder)["uavs"])
    fly_well(scenario, "--quiet", "--record", "npz", "--in-process", "--out", tmp_path / "expected")
    flown, expected = (arrays_of(tmp_path / name / "events.npz") for name in ("run", "expected"))
    for key, array in expected.items():
        assert array.tobytes() == flown[key].tobytes(), key


def test_by_the_clock_an_autopilot_is_back_within_two_seconds_of_simulated_time(
    scenario1: Scenario, tmp_path: Path
) -> None:
    """At half speed, for the load of machines that test."""
    scenario = scenario1.model_copy(update={"duration_s": 3.0, "faults": ()})
    how = {"speed": 0.5, "restart": True, "crashes": {2: [DIES_AT]}}
    flight = fly_and_record(scenario, tmp_path, **how)
    assert flight.restarts == (0, 1, 0)
    flown = np.flatnonzero(~flight.missing[:, 1])  # a busy machine costs steps before and after
    died, back = max(itertools.pairwise(flown), key=lambda gap: gap[1] - gap[0])
    assert DIES_AT <= died < back < died + 2000


def test_a_killed_autopilot_of_a_standing_fleet_comes_back_by_itself(tmp_path: Path) -> None:
    # slowly: a busy machine takes seconds to start a process, in which the aircraft would be lost
    with up(tmp_path / "fleet", "--start", "--speed", "0.1") as fleet:
        wait_until(lambda: state_of(fleet, 2)["time_s"] > 0.05, "it flies")
        before = state_of(fleet, 2)
        pid = process_of(fleet.folder, "uav2")
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: pid not in processes_of(fleet.folder), "it is dead")
        (after,) = status_when(
            fleet,
            lambda states: bool(states) and (states[0]["steps"] or 0) > before["steps"],
            "--uav",
            "2",
        )["vehicles"]
        assert (after["armed"], after["mode"]) == (True, before["mode"])
        assert after["profile"] == before["profile"]
        for name, channel in before["channels"].items():
            assert after["channels"][name]["events"] >= channel["events"]
        status, stderr = fleet.stop()
        assert status == 0
        assert stderr.strip() == "uav2: ended by signal 9; started again"
        assert not processes_of(fleet.folder)

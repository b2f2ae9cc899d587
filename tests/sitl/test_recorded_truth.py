"""Recordings hold what was flown: nothing is made up where an autopilot knew nothing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    CHANNELS,
    arrays_of,
    assert_one_message,
    fly,
    fly_well,
    free_links,
    scenario_tree,
    summary_of,
    write_scenario,
)
from numpy.lib.stride_tricks import sliding_window_view

from gcs.fleet.preparation import How, prepare
from gcs.scenario.model import Scenario
from gcs.testing.fixtures import launch
from gcs.testing.flying import TestFleet
from gcs.testing.results import FlightResult
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl

STEP_S = 1e-3
AHEAD_STEPS = 100  # over which an autopilot predicts at most
LOST_COMMAND_M_S = (
    10.7  # 107 m/s² of thrust believed or not for so long; what is made up is 40 m/s off
)


def impaired(folder: Path, duration_s: float, **plant: Any) -> Path:
    """A scenario whose simulator link has impairments."""
    links = free_links() | {"impairments": {"plant": plant}}
    return write_scenario(folder, scenario_tree(duration_s=duration_s, faults=[]), links=links)


def computed(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the signals of the autopilots as floats, steps and UAVs first."""
    of_the_plant = {"uav", "time_s", "state", "wind", "applied"}
    # never NaN
    whole = {"events", "phase", "neighbour_message", "report_size", "not_finite", "dead_steps"}
    others = of_the_plant | whole | {"predicted_exit", "path_position", "slot"}  # there are none
    return {name: values for name, values in arrays.items() if name not in others}


def assert_airspeeds_are_of_the_next_tenth_of_a_second(true: np.ndarray, used: np.ndarray) -> None:
    """The law uses the state at which its commands act: predicted over the delay, at most 0.1 s.

    How far ahead depends on the machine; and a prediction knows nothing of a command that is lost.
    """
    whole = len(true) - AHEAD_STEPS
    ahead = sliding_window_view(true, AHEAD_STEPS + 1, axis=0)
    known = ~np.isnan(used[:whole])
    off = np.maximum(ahead.min(axis=-1) - used[:whole], used[:whole] - ahead.max(axis=-1))[known]
    assert off.max() < LOST_COMMAND_M_S


def assert_nothing_is_made_up(folder: Path) -> None:
    """Missing steps are NaN and counted; errors are taken from the true state at every step."""
    summary, arrays = summary_of(folder), arrays_of(folder / "trajectory.npz")
    steps = summary["steps"]
    assert len(arrays["time_s"]) == len(arrays["state"]) == steps
    assert np.isfinite(arrays["state"]).all()
    missing = np.isnan(arrays["V"])
    for name, values in computed(arrays).items():
        assert (np.isnan(values).reshape(*missing.shape, -1).all(axis=2) == missing).all(), name
    assert not arrays["events"][missing].any()
    assert not arrays["phase"][missing].any()
    assert not arrays["neighbour_message"][missing].any()
    airspeed = np.linalg.norm(arrays["state"][:, :, 3:6], axis=2)
    assert_airspeeds_are_of_the_next_tenth_of_a_second(airspeed, arrays["V"])
    for i, uav in enumerate(summary["uavs"]):
        assert uav["missing_steps"] == np.count_nonzero(missing[:, i]) > 0
        assert uav["active_steps"] == steps - uav["missing_steps"]
        sent = sum(uav["channels"][name]["events"] for name in CHANNELS)
        assert uav["saving"] == pytest.approx(1.0 - sent / (4 * uav["active_steps"]))
        commanded = np.interp(  # the commands of these flights do not change
            np.arange(steps),
            np.flatnonzero(~missing[:, i]),
            arrays["command"][~missing[:, i], i, 0],
        )
        iae = np.abs(airspeed[:, i] - commanded).sum() * STEP_S
        assert uav["iae"]["airspeed"] == pytest.approx(iae, rel=1e-9)


def test_lost_states_are_missing_steps_and_not_zeros(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    scenario = impaired(tmp_path, 1.0, loss=0.05, seed=1)
    done = fly_well(scenario, "--speed", "1", "--record=npz", "--out", folder)
    summary = summary_of(folder)
    assert summary["completed"]
    assert_nothing_is_made_up(folder)
    for uav in summary["uavs"]:
        assert f"UAV {uav['id']} missed {uav['missing_steps']} of 1000 steps" in done.stdout
    reported = {
        m.get_srcSystem(): m.steps
        for _, m in read_tlog(folder / "flight.tlog")
        if isinstance(m, dialect.MAVLink_ftc_events_message)
    }
    assert reported == {uav["id"]: uav["active_steps"] for uav in summary["uavs"]}


def test_a_flight_whose_end_the_autopilots_do_not_see_is_not_completed(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    outages = [{"from_s": 0.3, "to_s": 0.5}, {"from_s": 0.7, "to_s": 600.0}]
    done = fly(
        impaired(tmp_path, 1.0, outages=outages), "--speed", "1", "--record=npz", "--out", folder
    )
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    summary = summary_of(folder)
    assert not summary["completed"]
    assert "UAV 1 did not hear the end of the flight" in summary["loss"]
    assert summary["loss"] in done.stderr
    assert (summary["steps"], summary["duration_s"]) == (1000, 1.0)
    assert_nothing_is_made_up(folder)
    assert all(uav["missing_steps"] >= 450 for uav in summary["uavs"])


@pytest.fixture(scope="module")
def rearmed(
    scenario1: Scenario, tmp_path_factory: pytest.TempPathFactory
) -> tuple[FlightResult, Any]:
    """A flight of which UAV 2 is disarmed from 1 s to 2 s, and the last FTC_EVENTS of UAV 2."""
    scenario = scenario1.model_copy(update={"duration_s": 6.0, "faults": ()})
    folder = tmp_path_factory.mktemp("rearmed")
    fleet: TestFleet = launch(prepare(scenario, How(free_ports=True)), folder)
    try:
        fleet.begin()
        fleet.run_until(1.0)
        fleet.uav(2).disarm(force=True)
        fleet.run_until(2.0)
        fleet.uav(2).arm()
        flight = fleet.run_to_end()
    finally:
        fleet.close()
    [*_, reported] = (
        m
        for _, m in read_tlog(fleet.folder / "flight.tlog")
        if m.get_type() == "FTC_EVENTS" and m.get_srcSystem() == 2
    )
    return flight, reported


def test_while_disarmed_the_measured_state_is_recorded(rearmed: tuple[FlightResult, Any]) -> None:
    recording = rearmed[0].recording
    uav = recording.signals[:, 1]
    truth = recording.response[:, 1]
    assert truth[1990, 0] < truth[1000, 0] - 10.0  # without thrust it slows down
    assert (uav["V"] == truth[:, 0]).all()
    assert (uav["attitude"] == truth[:, 1:]).all()
    disarmed = np.isnan(uav["command"][:, 0])
    assert np.flatnonzero(disarmed).tolist() == list(range(1001, 2001))
    for name in ("reference", "error", "sync_error", "demand", "beta_v", "omega_d"):
        gone = np.isnan(uav[name]).reshape(len(uav), -1)
        assert (gone.all(axis=1) == disarmed).all(), name
        assert (gone.any(axis=1) == disarmed).all(), name
    assert (uav["held"][disarmed, 3] == 0.0).all()
    assert (uav["held"][disarmed, :3] == uav["held"][1000, :3]).all()


def test_summary_and_telemetry_count_the_same_periods(rearmed: tuple[FlightResult, Any]) -> None:
    flight, reported = rearmed
    uav = flight.uav(2).summary
    assert (uav["active_steps"], uav["missing_steps"]) == (5000, 0) == (reported.steps, 0)
    claimed = [uav["channels"][name] for name in ("aileron", "elevator", "rudder", "throttle")]
    assert [c["events"] for c in claimed] == list(reported.events)
    assert [round(1e6 * c["min_interval_s"]) for c in claimed] == list(reported.min_interval_us)
    assert uav["actuator_messages"] == reported.messages
    assert uav["saving"] == pytest.approx(1.0 - sum(reported.events) / (4 * reported.steps))
    assert flight.uav(2).saving == pytest.approx(uav["saving"])  # of the tap's count
    assert flight.saving == pytest.approx(flight.summary["saving"])


def test_a_rearmed_uav_starts_from_where_it_is(rearmed: tuple[FlightResult, Any]) -> None:
    recording = rearmed[0].recording
    uav, truth = recording.signals[:, 1], recording.response[:, 1]
    again = 2001
    assert uav["events"][again] == 0b1111
    assert (uav["reference"][again] == truth[again]).all()
    assert (uav["reference_dot"][again] == 0.0).all()
    fresh = recording.signals[0, 1]
    for name in ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega"):
        assert uav[name][again] == fresh[name]
    throttle = uav["events"] >> 3 & 1
    assert throttle[4000:].sum() < 100  # estimates that had wound up made it 1800 of 2000 steps
    assert not rearmed[0].uav(2).attitude_lost_at_s

"""A flight's data as files that other tools read."""

import csv
from pathlib import Path

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.results.export import CSV_PERIOD_S, export_flight
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario


@pytest.fixture(scope="module")
def flight(scenario1: Scenario) -> Recording:
    return fly_in_process(scenario1.model_copy(update={"duration_s": 0.5}))


@pytest.fixture(scope="module")
def folder(flight: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    export_flight(flight, folder)
    return folder


def read(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_events_are_all_there(flight: Recording, folder: Path) -> None:
    rows = read(folder / "events.csv")
    with np.load(folder / "events.npz") as arrays:
        assert len(rows) == len(arrays["step"])
    sent = sum(int(bits).bit_count() for bits in flight.signals["events"].ravel())
    assert len(rows) == sent
    first = next(r for r in rows if r["uav"] == "2" and r["channel"] == "rudder")
    assert float(first["time_s"]) == 0.0
    held = flight.signals["held"][0, 1, 2]
    assert float(first["value_deg_or_n"]) == pytest.approx(np.degrees(held), rel=1e-5)


def test_the_trajectory_stands_in_both_files(flight: Recording, folder: Path) -> None:
    rows = read(folder / "trajectory.csv")
    assert len(rows) == 3 * round(0.5 / CSV_PERIOD_S)
    row = rows[-1]
    step = round(float(row["time_s"]) * 1000)
    assert (row["uav"], step) == ("3", 490)
    state, signals = flight.states[step, 2], flight.signals[step, 2]
    expected = {
        "altitude_m": -state[2],
        "v_m_s": state[4],
        "r_deg_s": np.degrees(state[11]),
        "pitch_deg": np.degrees(state[7]),
        "airspeed_m_s": signals["V"],
        "sync_error_airspeed_m_s": signals["sync_error"][0],
        "sync_error_yaw_deg": np.degrees(signals["sync_error"][3]),
        "held_elevator_deg": np.degrees(signals["held"][1]),
        "held_thrust_n": signals["held"][3],
        "applied_thrust_n": flight.applied[step, 2, 3],
    }
    for name, value in expected.items():
        assert float(row[name]) == pytest.approx(value, rel=1e-6, abs=1e-12), name
    with np.load(folder / "trajectory.npz") as arrays:
        assert np.array_equal(arrays["state"], flight.states)
        assert np.array_equal(arrays["error"], flight.signals["error"])

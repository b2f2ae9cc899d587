"""Flights in which a sensor fails: nothing changes before, the aircraft that has it does after."""

from typing import Any

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree

ONSET_S = 0.3


def states(*faults: dict[str, Any]) -> np.ndarray:
    """Return the true states of a short flight by sensors, (steps, uavs, 12)."""
    keys = {"navigation": "estimated", "duration_s": 2.0, "faults": [*faults]}
    return fly_in_process(scenario_of("here.yaml", scenario_tree("paper/scenario1") | keys)).states


@pytest.fixture(scope="module")
def healthy() -> np.ndarray:
    return states()


@pytest.mark.parametrize(
    "keys",
    [
        {"sensor": "gyro", "bias_deg_s": 3.0},
        {"sensor": "airspeed", "scale": 0.5},
        {"sensor": "accelerometer", "noise_factor": 10.0},
    ],
)
def test_a_fault_changes_the_flight_of_its_aircraft_from_its_start_on(
    keys: dict[str, Any], healthy: np.ndarray
) -> None:
    flown = states({"uav": 3, "start_s": ONSET_S, **keys})
    n = min(len(flown), len(healthy))
    before = np.arange(n) <= 1000 * ONSET_S
    assert np.array_equal(flown[:n][before], healthy[:n][before])
    assert not np.array_equal(flown[n - 1, 2], healthy[n - 1, 2])


def test_the_same_faults_make_the_same_flight() -> None:
    faults = [{"uav": 3, "sensor": "gyro", "failure": "garbage", "instance": 1, "start_s": ONSET_S}]
    assert np.array_equal(states(*faults), states(*faults))

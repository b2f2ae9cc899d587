"""Flights by sensors, one of which fails: what the aircraft is taken to do stays near the truth."""

from typing import Any

import numpy as np
import pytest

from ftc_autopilot.common.phases import LOST
from gcs.fleet.in_process import begin, fly_in_process, fly_on
from gcs.results.recording import Steps
from gcs.scenario.bundled import bundled_names
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

FAULTS = [name for name in bundled_names() if name.startswith("sensor_faults/")]
SETTLED = 8000  # steps
LARGEST_DEG = {"sensor_faults/gyro_garbage": 10.0}
"""Largest error of roll and pitch, where it is not 2°."""


def by_sensors(name: str, **changes: Any) -> Scenario:
    own = {"controller": {"kind": "surviving"}, "navigation": "estimated", **changes}
    return scenario_of(name, merged(scenario_tree(name), own))


@pytest.mark.parametrize("name", FAULTS)
def test_estimates_stay_near_the_truth(name: str) -> None:
    scenario = by_sensors(name)
    steps = Steps.room(scenario.steps, len(scenario.uavs), estimated=True)
    assert fly_on(scenario, begin(scenario), steps.part).loss is None
    true, estimated = steps.states[SETTLED:], steps.estimates[SETTLED:]
    angles = np.degrees(np.abs(estimated[..., 6:8] - true[..., 6:8]))
    assert angles.max() < LARGEST_DEG.get(name, 2.0)
    through = np.linalg.norm(true[..., 3:6] - steps.wind[SETTLED:], axis=-1)
    shown = np.linalg.norm(estimated[..., 3:6] - estimated[..., 12:15], axis=-1)
    assert np.abs(shown - through).max() < 5.0
    assert np.linalg.norm(estimated[..., :3] - true[..., :3], axis=-1).max() < 60.0
    assert steps.signals["phase"].max() < LOST  # no actuator is blamed for a sensor


@pytest.mark.parametrize("fault", ["loe_rudder", "stuck_trim_aileron_for_good", "thrust_loss"])
def test_the_diagnosis_of_actuators_finds_the_same_by_sensors(fault: str) -> None:
    found = []
    for navigation in ("true_state", "estimated"):
        scenario = by_sensors(f"faults/{fault}", navigation=navigation)
        flight = fly_in_process(scenario)
        assert flight.loss is None
        found.append({(i, c) for _, i, c in np.argwhere(flight.signals["phase"] == LOST)})
    assert found[0] == found[1]

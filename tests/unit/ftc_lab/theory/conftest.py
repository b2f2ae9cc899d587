"""Flights that several tests of the theory check."""

import pytest
from theory_flights import SCENARIO_1, scenario_with

from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, scenario_tree

CALM = {"duration_s": 2.0, "disturbance": {}, "faults": [], "trigger": {"mode": "periodic"}}


@pytest.fixture(scope="session")
def calm() -> tuple[Recording, Scenario]:
    """No fault, no disturbance, no trigger, nominal aircraft: 2 s."""
    scenario = scenario_with(**CALM)
    return fly_in_process(scenario), scenario


@pytest.fixture(scope="session")
def rough() -> tuple[Recording, Scenario]:
    """Triggers, disturbance, uncertainty, a switch of K1 at 1.5 s, two faults: 3 s."""
    tree = scenario_tree(SCENARIO_1)
    gains = [{"until_s": 1.5, "value": [50.0, 50.0, 51.0]}, {"value": [45.0, 45.0, 45.0]}]
    scenario = scenario_with(
        duration_s=3.0,
        uncertainty={"mass": 1.1, "inertia": 1.2, "coefficients": 0.9},
        controller=tree["controller"] | {"K1": gains},
        faults=[
            {"uav": 1, "actuator": "throttle", "effectiveness": 0.9, "start_s": 2.0, "end_s": 2.5},
            {"uav": 2, "actuator": "rudder", "stuck_deg": 0.0, "start_s": 2.0, "end_s": 2.1},
        ],
    )
    return fly_in_process(scenario), scenario

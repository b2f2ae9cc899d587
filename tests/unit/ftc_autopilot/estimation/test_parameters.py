"""Parameters of the estimator reach what they name."""

from pathlib import Path

import numpy as np
import pytest

from ftc_autopilot import estimation
from ftc_autopilot.common.records import in_si
from ftc_autopilot.estimation.config import EstimatorConfig, parameters_of
from ftc_autopilot.estimation.estimator import new_estimator
from ftc_autopilot.estimation.health import INCONSISTENT, WELL, exclude, note_test
from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.hot.navigation import new_navigation
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.config.models import ConfigError
from mavlink_defs.constants import BAROMETER


def config_of(scenario: Scenario, parameters: EstimatorParameters) -> EstimatorConfig:
    plant = scenario.plant_config()
    return EstimatorConfig(
        plant.sensors.navigation, plant.origin, scenario.step_us, scenario.aircraft, parameters
    )


def test_each_is_read_somewhere() -> None:
    text = "".join(path.read_text() for path in Path(estimation.__path__[0]).glob("*.py"))
    for name in EstimatorParameters.model_fields:
        assert f'["{in_si(name)[0]}"]' in text or f"parameters.{name}" in text, name


def test_a_scenario_has_them_and_the_autopilot_takes_them(scenario1: Scenario) -> None:
    tree = scenario1.model_dump() | {"estimator": {"gate_sigma": 3.0, "tilt_deg": 2.0}}
    config = scenario_of("own", tree).autopilot_config(1)
    known = new_navigation(config).state[0]["estimator"]["parameters"]
    assert known["gate"] == 9.0
    assert known["tilt_rad"] == pytest.approx(np.radians(2.0))
    with pytest.raises(ConfigError, match=r"estimator\.gate_sigma: expected"):
        scenario_of("own", tree | {"estimator": {"gate_sigma": 0.0}})


@pytest.mark.parametrize(("sigma", "fails"), [(5.0, False), (3.0, True)])
def test_a_gate_decides_what_fails(scenario1: Scenario, sigma: float, fails: bool) -> None:
    config = config_of(scenario1, EstimatorParameters(gate_sigma=sigma))
    assumed = parameters_of(config)[0]
    barometer = new_estimator(config).state[0]["sensors"][BAROMETER]
    assert [note_test(barometer, 16.0, assumed) for _ in range(100)][-1] == fails


def test_a_sensor_is_taken_back_and_later_each_time(scenario1: Scenario) -> None:
    config = config_of(scenario1, EstimatorParameters())
    assumed = parameters_of(config)[0]
    sensor = new_estimator(config).state[0]["sensors"][BAROMETER]
    passed = []
    for _ in range(6):
        exclude(sensor, INCONSISTENT)
        while sensor["reason"] != WELL:
            note_test(sensor, 1.0, assumed)
        passed.append(int(sensor["passed"]))
    assert passed == [50, 100, 200, 400, 400, 400]  # of 50 samples a second

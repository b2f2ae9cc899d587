"""The noise of IMUs is judged by what they differ in, not by the motion that all of them see."""

from typing import Any

import numpy as np
import pytest

from benchmarks.sensor_flights import Exclusion, watched
from ftc_autopilot.estimation.config import EstimatorConfig, parameters_of
from ftc_autopilot.estimation.health import NOISY, SILENT, WELL
from ftc_autopilot.estimation.imus import IMU, judge_imus, note_imu
from ftc_autopilot.estimation.state import FILTER
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACCELEROMETER, GYRO
from mavlink_defs.framing.codec import HIL_SENSOR
from sitl_plant.sensing.units import UPDATED

AXES = ("xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc")
NEW = UPDATED[GYRO] | UPDATED[ACCELEROMETER]


class Bench:
    """IMUs in a shaking aircraft: a new motion in each step, far larger than their noise."""

    def __init__(self, scenario: Scenario, imus: int, shaking: float = 50.0) -> None:
        plant = scenario.plant_config()
        sensors = plant.sensors.navigation.model_copy(update={"imus": imus})
        aircraft = scenario.aircraft_of(1)
        config = EstimatorConfig(sensors, plant.origin, scenario.step_us, aircraft)
        self.assumed: Any = parameters_of(config)[0]
        self.imus, self.filters = np.zeros(imus, IMU), np.zeros(imus, FILTER)
        self.imus["noise"] = 1.0
        self.primary = 0
        self._random, self._shaking = np.random.default_rng(7), shaking
        names = ("gyro_noise",) * 3 + ("force_noise",) * 3
        self._sigma = np.array([self.assumed[name] for name in names])

    def step(self, factors: list[float | None]) -> list[int]:
        """Take a sample of each IMU with a factor on its noise, None: none; return the reasons."""
        motion = self._shaking * self._sigma * self._random.normal(size=6)
        for imu, factor in zip(self.imus, factors, strict=True):
            sample = np.zeros(1, HIL_SENSOR)[0]
            noise = self._sigma * self._random.normal(size=6)
            sample["fields_updated"] = 0 if factor is None else NEW
            for name, value in zip(AXES, motion + (factor or 0.0) * noise, strict=True):
                sample[name] = value
            note_imu(imu, sample, self.assumed)
        self.primary = judge_imus(self.imus, self.filters, self.primary, self.assumed)
        return [int(reason) for reason in self.imus["reason"]]

    def steps(self, n: int, factors: list[float | None]) -> list[list[int]]:
        return [self.step(factors) for _ in range(n)]


@pytest.mark.parametrize("imus", [1, 2, 3])
def test_motion_is_no_noise(scenario1: Scenario, imus: int) -> None:
    found = Bench(scenario1, imus).steps(500, [1.0] * imus)
    assert np.ravel(found).max() == WELL


@pytest.mark.parametrize(("imus", "shaking"), [(2, 0.0), (3, 0.0), (2, 5.0), (3, 5.0)])
def test_the_noisy_one_is_found_in_motion_as_well(
    scenario1: Scenario, imus: int, shaking: float
) -> None:
    bench = Bench(scenario1, imus, shaking)
    bench.steps(100, [1.0] * imus)
    found = np.array(bench.steps(50, [100.0, *[1.0] * (imus - 1)]))
    assert np.flatnonzero(found[:, 0] == NOISY)[0] <= 25
    assert (found[:, 1:] == WELL).all()
    assert bench.primary == 1


def test_one_that_is_left_alone_is_not_tested(scenario1: Scenario) -> None:
    bench = Bench(scenario1, 2)
    bench.steps(100, [1.0, 1.0])
    found = np.array(bench.steps(500, [1.0, None]))
    assert (found[:, 0] == WELL).all()
    assert found[-1, 1] == SILENT


def test_one_that_was_noisy_is_taken_back_though_the_other_is_silent(scenario1: Scenario) -> None:
    bench = Bench(scenario1, 2)
    bench.steps(100, [1000.0, 1.0])
    assert bench.imus[0]["reason"] == NOISY
    assert bench.steps(2500, [1.0, None])[-1] == [WELL, SILENT]
    assert bench.primary == 0


# flights


def exclusions(name: str, **values: Any) -> list[Exclusion]:
    return watched(with_changes(name, ["estimated"], values))[1]


@pytest.mark.parametrize("seed", [41, 43])
def test_an_agile_aircraft_keeps_its_imus(seed: int) -> None:
    assert not exclusions("airframes/aerosonde", seed=seed, duration_s=4.0)


def test_long_control_periods_keep_the_imus() -> None:
    assert not exclusions("paper/scenario1", step_us=10_000, faults=[])


@pytest.mark.parametrize("step_us", [1000, 10_000])
def test_garbage_is_found_in_fast_motion(step_us: int) -> None:
    fault = {"uav": 2, "sensor": "gyro", "failure": "garbage", "instance": 1, "start_s": 0.3}
    values = {"seed": 41, "duration_s": 1.0, "step_us": step_us, "faults": [fault]}
    first, *rest = exclusions("airframes/aerosonde", **values)
    assert (first.uav, first.sensor, first.excluded) == (2, "imu 1", True)
    assert first.time_s <= 0.34
    assert not rest

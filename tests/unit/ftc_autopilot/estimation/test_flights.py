"""The estimator on flights: its errors, its covariance, its answers to sensors that fail."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.consistency import (
    JUDGED,
    Followed,
    airspeed_error,
    attitude_error,
    flown,
    follow,
    nees,
)
from ftc_autopilot.estimation.estimator import EstimatorConfig, estimate, new_estimator
from ftc_autopilot.estimation.output import REPORT
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_VELOCITY
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.framing.codec import SIM_STATE, SIM_STEP
from sitl_plant.loop.fleet import new_sensing
from sitl_plant.sensing.sense import sense

pytestmark = pytest.mark.slow

SEEDS = 100
LATE = 100  # samples of 0.1 s: after 10 s


@pytest.fixture(scope="module")
def flight() -> tuple[Scenario, np.ndarray]:
    scenario = load_scenario("paper/scenario1")
    return scenario, flown(scenario)


@pytest.fixture(scope="module")
def runs(flight: tuple[Scenario, np.ndarray]) -> list[Followed]:
    return [follow(*flight, seed) for seed in range(1, SEEDS + 1)]


def rms(values: np.ndarray) -> np.ndarray:
    mean: np.ndarray = np.sqrt(np.mean(values**2, axis=(0, 1)))
    return mean


def test_errors_after_ten_seconds_are_those_of_consumer_sensors(runs: list[Followed]) -> None:
    attitude = rms(np.array([attitude_error(run)[LATE:] for run in runs]))
    assert (attitude < (0.4, 0.4, 1.5)).all()
    assert rms(np.array([airspeed_error(run)[LATE:] for run in runs])) < 0.3
    assert (rms(np.array([run.error[LATE:, 15:17] for run in runs])) < 0.5).all()
    position = rms(np.array([run.error[LATE:, 6:9] for run in runs]))
    assert math.hypot(*position[:2]) < 1.5


def test_the_covariance_is_that_of_the_errors(runs: list[Followed]) -> None:
    """On the average of time; the figure of `benchmarks.consistency` shows it by time."""
    mean = np.mean([nees(run)[LATE:] for run in runs])
    assert 0.8 < mean < 1.5
    for run in runs:
        P = run.covariance[-1][np.ix_(JUDGED, JUDGED)]
        assert np.linalg.eigvalsh(P).min() > 0.0


def test_innovations_have_their_variance(runs: list[Followed]) -> None:
    """Of field and velocity the largest of 3, of a place the largest of 2: means 2.1 and 1.6."""
    ratios = np.mean([run.ratios[LATE:] for run in runs], axis=(0, 1))
    expected = {MAGNETOMETER: 2.1, BAROMETER: 1.0, GNSS: 1.6, GNSS_VELOCITY: 2.1, GNSS_HEIGHT: 1.0}
    for sensor, mean in expected.items():
        assert ratios[sensor] == pytest.approx(mean, rel=0.15)
    assert ratios[PITOT] < 1.1


def test_no_sensor_is_excluded_without_a_fault(runs: list[Followed]) -> None:
    assert not any(run.bad.any() for run in runs)


# faults, from 10 s on


def fly_with_fault(
    flight: tuple[Scenario, np.ndarray],
    fault: Callable[[np.ndarray, np.void, bool], bool],
    end_s: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return reports, estimated states and true motion by step, of a flight with a fault.

    Args:
        flight: Its scenario and its motion.
        fault: Changes records of the IMUs and the GNSS receiver from 10 s on, and returns
            whether the latter is delivered.
        end_s: When it ends.
    """
    scenario, motion = flight
    plant = scenario.plant_config(speed=None)
    aircraft = scenario.aircraft_of(scenario.uavs[0].id)
    steps = round(end_s * 1e6 / scenario.step_us)
    true = motion[:steps, 0]
    estimator = new_estimator(
        EstimatorConfig(plant.sensors.navigation, plant.origin, scenario.step_us, aircraft)
    )
    sensing = new_sensing(plant)
    truth, sim_step = np.zeros(1, SIM_STATE)[0], np.zeros(1, SIM_STEP)[0]
    reports, states = np.zeros(steps, REPORT), np.zeros(steps, SIM_STATE)
    names = ("position", "velocity", "attitude", "rates", "specific_force", "wind")
    for k in range(steps):
        truth["time_usec"], truth["step"] = k * scenario.step_us, k
        sim_step["time_usec"], sim_step["step"] = k * scenario.step_us, k
        for part, name in enumerate(names):
            truth[name] = true[k, 3 * part : 3 * part + 3]
        delivered = sense(sensing, 0, k, truth)
        imus, gps = sensing.imus[0].copy(), sensing.gps[0].copy()
        if k * scenario.step_us > 10e6:
            delivered = fault(imus, gps, delivered)
        estimate(estimator.state[0], estimator.history, imus, gps, delivered, sim_step, states[k])
        reports[k] = estimator.state[0]["report"]
    return reports, states, true


def silence_imu(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["fields_updated"] &= 0x1FC0
    return delivered


def bias_gyro(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["ygyro"] += math.radians(3.0)
    return delivered


def bias_accelerometer(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["xacc"] += 1.0
    return delivered


def stick_gyro(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["xgyro"], imus[0]["ygyro"], imus[0]["zgyro"] = 0.01, 0.0, 0.0
    return delivered


@pytest.mark.parametrize("fault", [silence_imu, bias_gyro, bias_accelerometer, stick_gyro])
def test_the_other_imu_takes_over_within_half_a_second(
    flight: tuple[Scenario, np.ndarray], fault: Callable[[np.ndarray, np.void, bool], bool]
) -> None:
    reports, states, true = fly_with_fault(flight, fault, 11.0)
    assert (reports["imu"][:10_000] == 0).all()
    assert (reports["imu"][10_500:] == 1).all()
    assert (reports["bad_imus"][10_500:] == 1).all()
    error = np.degrees(states["attitude"] - true[:, 6:9])[10_000:, :2]
    assert np.abs(error).max() < 5.0


def block_pitot(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["diff_pressure"] = 12.0
    return delivered


def empty_pitot(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["diff_pressure"] = 0.0
    return delivered


def silence_pitot(imus: np.ndarray, _gps: np.void, delivered: bool) -> bool:
    imus[0]["fields_updated"] &= 0x1BFF
    return delivered


@pytest.mark.parametrize("fault", [block_pitot, empty_pitot, silence_pitot])
def test_a_pitot_tube_that_fails_is_excluded_and_the_airspeed_stays(
    flight: tuple[Scenario, np.ndarray], fault: Callable[[np.ndarray, np.void, bool], bool]
) -> None:
    reports, states, true = fly_with_fault(flight, fault, 14.0)
    assert (reports["synthetic_airspeed"][9_000:10_000] == 0).all()
    assert (reports["synthetic_airspeed"][13_000:] == 1).all()
    speed = np.linalg.norm(states["velocity"] - states["wind"], axis=1)
    assert np.abs(speed - np.linalg.norm(true[:, 3:6] - true[:, 15:18], axis=1))[5000:].max() < 3.0


def lose_gnss(_imus: np.ndarray, _gps: np.void, _delivered: bool) -> bool:
    return False


def shift_gnss(_imus: np.ndarray, gps: np.void, delivered: bool) -> bool:
    gps["lat"] += 4500  # 50 m
    return delivered


def age_gnss(_imus: np.ndarray, gps: np.void, delivered: bool) -> bool:
    """Of a simulator whose clock stands: a fix of long ago says nothing of now."""
    gps["time_usec"] = 1
    return delivered


@pytest.mark.parametrize("fault", [lose_gnss, shift_gnss, age_gnss])
def test_without_gnss_it_reckons(
    flight: tuple[Scenario, np.ndarray], fault: Callable[[np.ndarray, np.void, bool], bool]
) -> None:
    reports, states, true = fly_with_fault(flight, fault, 14.0)
    assert (reports["dead_reckoning"][11_000:] == 1).all()
    assert np.abs(states["position"] - true[:, :3])[9000:].max() < 6.0


def test_a_second_call_for_a_step_changes_nothing() -> None:
    scenario = load_scenario("paper/scenario1")
    plant = scenario.plant_config(speed=None)
    aircraft = scenario.aircraft_of(scenario.uavs[0].id)
    config = EstimatorConfig(plant.sensors.navigation, plant.origin, scenario.step_us, aircraft)
    estimator = new_estimator(config)
    sensing = new_sensing(plant)
    truth, sim_step = np.zeros(1, SIM_STATE)[0], np.zeros(1, SIM_STEP)[0]
    truth["velocity"][0], truth["specific_force"][2] = 40.0, -9.8
    measured = np.zeros(2, SIM_STATE)
    for k in range(300):
        sim_step["step"], sim_step["time_usec"] = k, k * 1000
        delivered = sense(sensing, 0, k, truth)
        args = sensing.imus[0], sensing.gps[0], delivered, sim_step
        estimate(estimator.state[0], estimator.history, *args, measured[0])
        before = [array.tobytes() for array in estimator]
        estimate(estimator.state[0], estimator.history, *args, measured[1])
        assert before == [array.tobytes() for array in estimator]
        assert measured[0] == measured[1]

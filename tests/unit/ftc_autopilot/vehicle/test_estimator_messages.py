"""What stations hear of a vehicle's estimate of its state, and of its sensors."""

import math
from typing import Any

import numpy as np
import pytest
from vehicle_bench import Bench, of_type

from ftc_autopilot.estimation.health import INCONSISTENT, SILENT, STUCK, WELL
from ftc_autopilot.estimation.parameters import EstimatorParameters
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT

GATE = EstimatorParameters().gate_sigma ** 2
GPS = dialect.MAV_SYS_STATUS_SENSOR_GPS
PITOT_BIT = dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
GYRO, AHRS = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO, dialect.MAV_SYS_STATUS_AHRS
ABSOLUTE = dialect.ESTIMATOR_POS_HORIZ_ABS | dialect.ESTIMATOR_PRED_POS_HORIZ_ABS
ALL_KNOWN = 0b11_0111_1111


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    bench = Bench(scenario1.model_copy(update={"navigation": "estimated"}))
    bench.hot.measured["time_usec"] = 12_340_000
    bench.run()
    report(bench)["aligned"] = 1
    said(bench)
    return bench


def report(bench: Bench) -> Any:
    return bench.hot.navigation["estimator"]["report"]


def made(bench: Bench, number: int) -> Any:
    return bench.vehicle.telemetry[0].make(number)


def said(bench: Bench) -> list[str]:
    """Texts of what the vehicle says at its next timer."""
    bench.now += 0.01
    bench.vehicle.handle_timer(bench.now)
    texts: dict[int, str] = {}
    for chunk in of_type(bench.vehicle.gcs_messages(), "STATUSTEXT"):
        texts[chunk.id] = texts.get(chunk.id, "") + chunk.text
    return list(texts.values())


def test_ratios_are_innovations_over_their_limit(bench: Bench) -> None:
    for sensor, squared in (
        (MAGNETOMETER, GATE),
        (BAROMETER, GATE / 4.0),
        (PITOT, 4.0 * GATE),
        (GNSS, 0.0),
    ):
        report(bench)["ratios"][sensor] = squared
    report(bench)["position_std"] = (3.0, 4.0, 7.0)
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert (status.mag_ratio, status.pos_vert_ratio) == (1.0, 0.5)
    assert (status.tas_ratio, status.vel_ratio, status.pos_horiz_ratio) == (2.0, 0.0, 0.0)
    assert (status.pos_horiz_accuracy, status.pos_vert_accuracy) == (5.0, 7.0)
    assert status.flags & ABSOLUTE == ABSOLUTE
    arducopter = made(bench, dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
    assert (arducopter.compass_variance, arducopter.airspeed_variance) == (1.0, 2.0)
    assert arducopter.flags == status.flags


def test_dead_reckoning_and_a_start_show_in_the_flags(bench: Bench) -> None:
    report(bench)["dead_reckoning"] = 1
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert not status.flags & ABSOLUTE
    assert status.flags & dialect.ESTIMATOR_ATTITUDE
    report(bench)["aligned"] = 0
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags == 0
    assert not made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & AHRS


def test_excluded_sensors_are_announced_once_and_are_not_healthy(bench: Bench) -> None:
    report(bench)["reasons"][PITOT], report(bench)["reasons"][GNSS] = STUCK, SILENT
    texts = said(bench)
    assert texts == [
        "pitot excluded at 12.34 s: stuck, airspeed by wind and model",
        "GNSS excluded at 12.34 s: silent, dead reckoning",
    ]
    assert said(bench) == []
    status = made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS)
    assert status.onboard_control_sensors_present & (GPS | PITOT_BIT) == GPS | PITOT_BIT
    assert not status.onboard_control_sensors_health & (GPS | PITOT_BIT)
    bench.hot.measured["time_usec"] += 1_000_000
    report(bench)["reasons"][GNSS] = WELL
    assert said(bench) == ["GNSS back in use at 13.34 s"]
    assert made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GPS


def test_an_excluded_imu_is_announced_and_gyros_are_unhealthy_when_none_is_left(
    bench: Bench,
) -> None:
    report(bench)["imu_reasons"][0], report(bench)["imu"] = INCONSISTENT, 1
    assert said(bench) == ["IMU 1 excluded at 12.34 s: inconsistent, flying by IMU 2"]
    assert made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GYRO
    report(bench)["imu_reasons"][1] = SILENT
    assert not made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GYRO


def test_the_covariance_of_the_attitude_is_of_roll_pitch_and_yaw(bench: Bench) -> None:
    """In level flight to the east, a turn about north is a pitch, and one about east a roll."""
    bench.hot.measured["attitude"] = (0.0, 0.0, math.pi / 2.0)
    P = bench.hot.navigation["estimator"]["filters"][0]["P"]
    P[0, 0], P[1, 1], P[2, 2] = 1e-4, 4e-4, 9e-4
    message = made(bench, dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV)
    covariance = np.reshape(message.covariance, (3, 3))
    assert np.allclose(covariance, np.diag([4e-4, 1e-4, 9e-4]), atol=1e-9)
    assert np.allclose(message.q, [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])


def test_the_covariance_of_the_position_is_on_the_diagonal(bench: Bench) -> None:
    report(bench)["position_std"], report(bench)["velocity_std"] = (1, 2, 3), (0.1, 0.2, 0.3)
    message = made(bench, dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT_COV)
    covariance = np.reshape(message.covariance, (6, 6))
    assert np.allclose(np.diag(covariance), [1.0, 4.0, 9.0, 0.01, 0.04, 0.09])
    assert covariance.sum() == pytest.approx(np.trace(covariance))
    assert message.vx == pytest.approx(40.0)


def test_by_true_states_all_is_known(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert status.flags == ALL_KNOWN
    assert status.mag_ratio == status.pos_horiz_accuracy == 0.0
    assert not any(made(bench, dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV).covariance)

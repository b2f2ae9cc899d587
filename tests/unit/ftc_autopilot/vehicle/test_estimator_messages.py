"""What stations hear of a vehicle's estimate of its state, and of its sensors."""

import math
from typing import Any

import numpy as np
import pytest
from vehicle_bench import Bench, of_type

from ftc_autopilot.estimation.health import ABSENT, INCONSISTENT, SILENT, STUCK, WELL
from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_VELOCITY
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import vec3

GATE = EstimatorParameters().gate_sigma ** 2
GPS = dialect.MAV_SYS_STATUS_SENSOR_GPS
PITOT_BIT = dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
GYRO, AHRS = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO, dialect.MAV_SYS_STATUS_AHRS
ABSOLUTE = dialect.ESTIMATOR_POS_HORIZ_ABS | dialect.ESTIMATOR_PRED_POS_HORIZ_ABS
ALL_KNOWN = 0b11_0011_1111  # but the height above the ground
HEIGHT = dialect.ESTIMATOR_POS_VERT_ABS
EKF_UNINITIALIZED, EKF_GPS_GLITCHING = 1024, 32768


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    bench = Bench(scenario1.model_copy(update={"navigation": "estimated"}))
    bench.hot.measured["time_usec"] = 12_340_000
    bench.run()
    report(bench)["aligned"] = report(bench)["placed"] = 1
    bench.hot.navigation["step"] = bench.hot.navigation["gps_step"] = 12_340
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
        (GNSS, 9.0 * GATE),
        (GNSS_VELOCITY, 16.0 * GATE),
        (GNSS_HEIGHT, 0.01 * GATE),
    ):
        report(bench)["ratios"][sensor] = squared
    report(bench)["position_std"] = (3.0, 4.0, 7.0)
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert (status.mag_ratio, status.pos_vert_ratio) == (1.0, 0.5)
    assert (status.tas_ratio, status.vel_ratio, status.pos_horiz_ratio) == (2.0, 4.0, 3.0)
    assert math.isnan(status.hagl_ratio)
    assert (status.pos_horiz_accuracy, status.pos_vert_accuracy) == (5.0, 7.0)
    assert status.flags & ABSOLUTE == ABSOLUTE
    arducopter = made(bench, dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
    assert (arducopter.compass_variance, arducopter.airspeed_variance) == (1.0, 2.0)
    assert arducopter.terrain_alt_variance == 0.0
    assert arducopter.flags == status.flags == ALL_KNOWN
    report(bench)["ratios"][GNSS_HEIGHT] = GATE
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).pos_vert_ratio == 1.0


@pytest.mark.parametrize(
    ("sensor", "ratio", "variance"),
    [
        (GNSS, "vel_ratio", "velocity_variance"),
        (GNSS, "pos_horiz_ratio", "pos_horiz_variance"),
        (MAGNETOMETER, "mag_ratio", "compass_variance"),
        (PITOT, "tas_ratio", "airspeed_variance"),
    ],
)
@pytest.mark.parametrize("is_fitted", [True, False])
def test_a_sensor_that_says_nothing_has_no_ratio(
    sensor: int, ratio: str, variance: str, is_fitted: bool, bench: Bench
) -> None:
    """The last one would stand there for ever. NaN as PX4 has it, 0 as ArduPilot has it."""
    report(bench)["ratios"] = GATE
    one = bench.hot.navigation["estimator"]["sensors"][sensor]
    if is_fitted:
        one["silent"] = one["most_silent"] + 1
    else:
        one["reason"] = ABSENT
    assert math.isnan(getattr(made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS), ratio))
    assert getattr(made(bench, dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT), variance) == 0.0
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).pos_vert_ratio == 1.0


def test_dead_reckoning_and_a_start_show_in_the_flags(bench: Bench) -> None:
    report(bench)["dead_reckoning"] = 1
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert not status.flags & ABSOLUTE
    assert status.flags & dialect.ESTIMATOR_ATTITUDE
    assert status.flags & dialect.ESTIMATOR_VELOCITY_HORIZ
    assert not status.flags & dialect.ESTIMATOR_CONST_POS_MODE
    report(bench)["synthetic_airspeed"] = 1
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert not status.flags & dialect.ESTIMATOR_VELOCITY_HORIZ
    assert status.flags & dialect.ESTIMATOR_CONST_POS_MODE
    report(bench)["aligned"] = 0
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags == 0
    assert made(bench, dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT).flags == EKF_UNINITIALIZED
    assert not made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & AHRS


STREAMED_PLACES = {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"}
PLACES = STREAMED_PLACES | {
    "GLOBAL_POSITION_INT_COV",
    "ODOMETRY",
    "POSITION_TARGET_GLOBAL_INT",
}


def test_before_the_first_fix_no_place_is_claimed(bench: Bench) -> None:
    def streamed() -> set[str]:
        bench.now += 1.0
        bench.hot.measured["time_usec"] += 1_000_000
        bench.vehicle.handle_timer(bench.now)
        return {message.get_type() for message in bench.vehicle.gcs_messages()}

    report(bench)["placed"] = 0
    flags = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags
    assert flags & (dialect.ESTIMATOR_ATTITUDE | HEIGHT) == dialect.ESTIMATOR_ATTITUDE | HEIGHT
    assert not flags & (ABSOLUTE | dialect.ESTIMATOR_POS_HORIZ_REL)
    assert not made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GPS
    for name in PLACES:
        number = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
        result = bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, number)
        assert result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
    assert not streamed() & PLACES
    report(bench)["placed"] = 1
    assert streamed() >= STREAMED_PLACES
    assert all(made(bench, getattr(dialect, f"MAVLINK_MSG_ID_{name}")) for name in PLACES)


def test_a_receiver_that_is_heard_and_excluded_is_a_glitch(bench: Bench) -> None:
    for reason, glitch in ((INCONSISTENT, True), (STUCK, True), (SILENT, False), (WELL, False)):
        report(bench)["reasons"][GNSS] = reason
        status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
        assert bool(status.flags & dialect.ESTIMATOR_GPS_GLITCH) == glitch
        ekf = made(bench, dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
        assert bool(ekf.flags & EKF_GPS_GLITCHING) == glitch
        assert not ekf.flags & EKF_UNINITIALIZED


def test_without_barometer_and_fix_no_height_is_known(bench: Bench) -> None:
    report(bench)["reasons"][BAROMETER] = SILENT
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags & HEIGHT
    report(bench)["dead_reckoning"] = 1
    assert not made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags & HEIGHT


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


def test_parts_of_a_receiver_are_announced_by_themselves(bench: Bench) -> None:
    report(bench)["reasons"][GNSS] = report(bench)["reasons"][GNSS_HEIGHT] = INCONSISTENT
    assert said(bench) == ["GNSS excluded at 12.34 s: inconsistent, place by its velocity"]
    bench.hot.measured["time_usec"] += 1_000_000
    report(bench)["reasons"][GNSS] = WELL
    report(bench)["reasons"][GNSS_VELOCITY] = INCONSISTENT
    assert said(bench) == [
        "GNSS back in use at 13.34 s",
        "GNSS velocity excluded at 13.34 s: inconsistent, velocity by air and IMU",
        "GNSS height excluded at 13.34 s: inconsistent, height by barometer",
    ]
    assert not made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GPS


def test_a_receiver_that_is_late_is_announced(bench: Bench) -> None:
    report(bench)["delay"], report(bench)["delay_std"] = 0.3, 0.11
    assert said(bench) == [], "it may be as it says"
    report(bench)["delay_std"] = 0.05
    assert said(bench) == ["GNSS latency 0.30 s more than it says at 12.34 s"]
    bench.hot.measured["time_usec"] += 1_000_000
    report(bench)["delay"] = 0.25
    assert said(bench) == []
    report(bench)["delay"] = -0.2
    assert said(bench) == ["GNSS latency 0.20 s less than it says at 13.34 s"]
    bench.hot.measured["time_usec"] += 1_000_000
    report(bench)["delay"] = 0.01
    assert said(bench) == ["GNSS latency as it says at 14.34 s"]


def test_an_excluded_imu_is_announced_and_gyros_are_unhealthy_when_none_is_left(
    bench: Bench,
) -> None:
    report(bench)["imu_reasons"][0], report(bench)["imu"] = INCONSISTENT, 1
    assert said(bench) == ["IMU 1 excluded at 12.34 s: inconsistent, flying by IMU 2"]
    assert made(bench, dialect.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health & GYRO
    error = dialect.ESTIMATOR_ACCEL_ERROR
    assert not made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags & error
    report(bench)["imu_reasons"][1] = SILENT
    assert made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS).flags & error
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


def test_the_wind_has_the_accuracy_of_the_estimate(bench: Bench) -> None:
    report(bench)["wind_std"] = (0.3, 0.4, 0.2)
    wind = made(bench, dialect.MAVLINK_MSG_ID_WIND_COV)
    assert (wind.var_horiz, wind.var_vert) == pytest.approx((0.25, 0.04))
    assert (wind.horiz_accuracy, wind.vert_accuracy) == pytest.approx((0.5, 0.2))


def upper_to_whole(upper: list[float]) -> np.ndarray:
    whole = np.zeros((6, 6))
    whole[np.triu_indices(6)] = upper
    return whole + np.triu(whole, 1).T


def test_odometry_has_the_covariance_of_pose_and_velocity(bench: Bench) -> None:
    """Against samples of the filter's error, put through the exact equations."""
    rng = np.random.default_rng(5)
    attitude, velocity = np.array([0.3, 0.2, 1.1]), np.array([38.0, 2.0, -1.0])
    bench.hot.measured["attitude"], bench.hot.measured["velocity"] = attitude, velocity
    mix = rng.normal(0.0, 1e-3, (9, 9))  # attitude, velocity, position
    mix[3:] *= 30.0
    bench.hot.navigation["estimator"]["filters"][0]["P"][:9, :9] = mix @ mix.T
    errors = rng.normal(0.0, 1.0, (40_000, 9)) @ mix.T
    R = np.array(R1(vec3(attitude)))
    turned = np.eye(3) + np.cross(np.eye(3)[None, :, :], -errors[:, None, :3])
    true_R = np.moveaxis(turned, 1, 2) @ R
    angles = np.column_stack(
        [
            np.arctan2(true_R[:, 2, 1], true_R[:, 2, 2]),
            -np.arcsin(true_R[:, 2, 0]),
            np.arctan2(true_R[:, 1, 0], true_R[:, 0, 0]),
        ]
    )
    body = np.einsum("nij,ni->nj", true_R, R @ velocity + errors[:, 3:6])
    message = made(bench, dialect.MAVLINK_MSG_ID_ODOMETRY)
    pose = upper_to_whole(message.pose_covariance)
    assert pose == pytest.approx(np.cov(np.hstack([errors[:, 6:], angles]).T), rel=0.1, abs=2e-5)
    moving = upper_to_whole(message.velocity_covariance)
    assert moving[:3, :3] == pytest.approx(np.cov(body.T), rel=0.05, abs=2e-4)
    assert np.isnan(moving[3:]).all()  # of the rates nothing is stated


def test_by_true_states_all_is_known(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    status = made(bench, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert status.flags == ALL_KNOWN | dialect.ESTIMATOR_POS_VERT_AGL
    assert status.mag_ratio == status.pos_horiz_accuracy == 0.0
    assert not any(made(bench, dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV).covariance)

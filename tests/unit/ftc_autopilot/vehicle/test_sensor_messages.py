"""What stations hear of a vehicle's sensors: samples as they came, and silence."""

import math
from typing import Any

import pytest
from vehicle_bench import Bench

from ftc_autopilot.estimation.health import ABSENT
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.dialect import (
    MAV_RESULT_ACCEPTED,
    MAV_RESULT_TEMPORARILY_REJECTED,
    MAV_RESULT_UNSUPPORTED,
)

STEP = 20_000  # of 1 ms
UINT16 = 2**16 - 1
IMU, FIELD, PRESSURE, PITOT_BIT = 0x3F, 0x1C0, 0x1A00, 0x400
FIX = {
    "fix_type": 3,
    "lat": -353_000_000,
    "lon": 1_491_000_000,
    "alt": 612_345,
    "eph": 91,
    "epv": 133,
    "vel": 4021,
    "cog": 27_010,
    "satellites_visible": 9,
    "yaw": 0,
}
FIRST: dict[str, float] = {
    "xacc": 0.5,
    "yacc": -0.25,
    "zacc": -9.80665,
    "xgyro": 0.125,
    "ygyro": -0.25,
    "zgyro": 0.5,
    "xmag": 0.25,
    "ymag": -0.0625,
    "zmag": -0.5,
    "abs_pressure": 950.0,
    "diff_pressure": 9.5,
    "pressure_alt": 540.0,
    "temperature": 11.5,
}


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    """In flight for 20 s, with all that two IMUs and a receiver have said by then."""
    bench = Bench(scenario1.model_copy(update={"navigation": "estimated"}))
    bench.run()
    navigation = bench.hot.navigation
    for step in (0, STEP):  # the clock of the vehicle follows
        bench.hot.measured["time_usec"] = 1000 * step
        bench.vehicle.handle_timer(0.0)
    bench.hot.step = navigation["step"] = STEP
    navigation["gps_step"], navigation["gps"]["time_usec"] = STEP - 40, 1000 * (STEP - 240)
    for name, number in FIX.items():
        navigation["gps"][name] = number
    for k, imu in enumerate(navigation["imus"]):
        imu["time_usec"], imu["id"], imu["fields_updated"] = 1000 * STEP, k, IMU
        for name, value in FIRST.items():
            imu[name] = value * (1.0 if k == 0 else 2.0)
    return bench


def made(bench: Bench, name: str) -> Any:
    return bench.vehicle.telemetry[0].make(getattr(dialect, f"MAVLINK_MSG_ID_{name}"))


def request(bench: Bench, name: str) -> int:
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    return bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, number)


def sensor(bench: Bench, number: int) -> Any:
    return bench.hot.navigation["estimator"]["sensors"][number]


def silence(bench: Bench, number: int) -> None:
    sensor(bench, number)["silent"] = sensor(bench, number)["most_silent"] + 1


def test_the_receiver_is_shown_as_it_reports_with_the_time_of_its_measurement(bench: Bench) -> None:
    gps = made(bench, "GPS_RAW_INT")
    assert {name: getattr(gps, name) for name in FIX} == FIX
    assert gps.time_usec == made(bench, "SYSTEM_TIME").time_boot_ms * 1000 - 240_000
    bench.hot.navigation["gps"]["fix_type"] = dialect.GPS_FIX_TYPE_2D_FIX
    assert made(bench, "GPS_RAW_INT").fix_type == dialect.GPS_FIX_TYPE_2D_FIX


@pytest.mark.parametrize("is_fitted", [True, False])
def test_of_a_receiver_that_is_silent_nothing_is_known(bench: Bench, is_fitted: bool) -> None:
    """As PX4 has it; the limit is the estimator's."""
    navigation, limit = bench.hot.navigation, int(sensor(bench, GNSS)["most_silent"])
    if not is_fitted:
        sensor(bench, GNSS)["reason"] = ABSENT
    navigation["gps_step"] = STEP - limit
    assert made(bench, "GPS_RAW_INT").fix_type == 3
    for silent_since in (STEP - limit - 1, -1):  # or it has never been heard
        navigation["gps_step"] = silent_since
        gps = made(bench, "GPS_RAW_INT")
        no_fix = dialect.GPS_FIX_TYPE_NO_FIX if is_fitted else dialect.GPS_FIX_TYPE_NO_GPS
        assert (gps.fix_type, gps.satellites_visible) == (no_fix, 255)
        assert (gps.eph, gps.epv, gps.vel, gps.cog) == (UINT16,) * 4
        assert (gps.lat, gps.lon, gps.alt) == (0, 0, 0)


def test_highres_imu_is_of_the_imu_flown_by_and_says_which_sensors_speak(bench: Bench) -> None:
    message = made(bench, "HIGHRES_IMU")
    assert {name: getattr(message, name) for name in FIRST} == pytest.approx(FIRST)
    assert (message.id, message.fields_updated) == (0, IMU | FIELD | PRESSURE | PITOT_BIT)
    bench.hot.navigation["estimator"]["report"]["imu"] = 1
    silence(bench, PITOT)
    silence(bench, BAROMETER)
    message = made(bench, "HIGHRES_IMU")
    assert (message.xgyro, message.zacc) == (0.25, pytest.approx(-2 * 9.80665))
    assert (message.id, message.fields_updated, message.xmag) == (1, IMU | FIELD, 0.25)
    silent = ("abs_pressure", "pressure_alt", "temperature", "diff_pressure")
    assert all(math.isnan(getattr(message, name)) for name in silent)


def test_an_imu_that_is_lost_shows_no_samples(bench: Bench) -> None:
    bench.hot.navigation["imus"][0]["fields_updated"] = 0
    assert made(bench, "HIGHRES_IMU").fields_updated & IMU == IMU  # one sample is not missed
    bench.hot.navigation["estimator"]["imus"][0]["silent"] = 50
    message = made(bench, "HIGHRES_IMU")
    assert message.fields_updated & IMU == 0
    assert math.isnan(message.xacc)
    assert math.isnan(message.zgyro)
    assert request(bench, "SCALED_IMU") == MAV_RESULT_TEMPORARILY_REJECTED
    assert request(bench, "SCALED_IMU2") == MAV_RESULT_ACCEPTED


def test_scaled_messages_are_of_each_imu_in_their_units(bench: Bench) -> None:
    first, second = made(bench, "SCALED_IMU"), made(bench, "SCALED_IMU2")
    assert (first.xacc, first.yacc, first.zacc) == (51, -25, -1000)  # mG
    assert (first.xgyro, first.ygyro, first.zgyro) == (125, -250, 500)  # mrad/s
    assert (first.xmag, first.ymag, first.zmag) == (250, -62, -500)  # mgauss
    assert (second.zacc, second.zgyro, second.xmag) == (-2000, 1000, 0)
    assert made(bench, "SCALED_IMU3") is None  # two are fitted
    pressure = made(bench, "SCALED_PRESSURE")
    assert (pressure.press_abs, pressure.press_diff, pressure.temperature) == (950.0, 9.5, 1150)
    assert pressure.time_boot_ms == first.time_boot_ms == made(bench, "ATTITUDE").time_boot_ms
    silence(bench, MAGNETOMETER)
    silence(bench, PITOT)
    assert made(bench, "SCALED_IMU").xmag == 0
    assert math.isnan(made(bench, "SCALED_PRESSURE").press_diff)
    silence(bench, BAROMETER)
    assert made(bench, "SCALED_PRESSURE") is None


def test_before_the_first_step_no_sensor_has_spoken(bench: Bench) -> None:
    bench.hot.navigation["step"] = bench.hot.navigation["gps_step"] = -1
    bench.hot.navigation["imus"]["fields_updated"] = 0
    assert made(bench, "HIGHRES_IMU").fields_updated == 0
    assert made(bench, "GPS_RAW_INT").fix_type == dialect.GPS_FIX_TYPE_NO_FIX
    assert made(bench, "SCALED_PRESSURE") is None


def test_by_the_true_state_there_are_no_such_sensors(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    assert (
        request(bench, "SCALED_IMU") == request(bench, "SCALED_PRESSURE") == MAV_RESULT_UNSUPPORTED
    )
    assert made(bench, "HIGHRES_IMU").fields_updated == IMU
    assert made(bench, "GPS_RAW_INT").fix_type == dialect.GPS_FIX_TYPE_3D_FIX
    raw = dialect.MAV_DATA_STREAM_RAW_SENSORS
    bench.run()
    bench.say(dialect.MAVLink_request_data_stream_message(1, 1, raw, 10, 1))
    bench.vehicle.handle_timer(1.0)
    assert bench.vehicle.gcs_messages()

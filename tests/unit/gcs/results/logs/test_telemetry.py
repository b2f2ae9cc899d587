"""Telemetry logs, of our fleet and of others."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.framing.frames import FramePacker

DATA = Path(__file__).parents[4] / "data"
BEGIN_S = 1_700_000_000.0
PLANE, ARDUPILOT = dialect.MAV_TYPE_FIXED_WING, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA

Timed = tuple[float, dialect.MAVLink_message]


def written(path: Path, *streams: tuple[int, Sequence[Timed]]) -> Path:
    """A log of what systems sent, each message with the time when it was heard [s]."""
    packers = {system: FramePacker(system, 1) for system, _ in streams}
    frames = [
        (at, packers[system].pack(message)) for system, timed in streams for at, message in timed
    ]
    with TlogWriter(path) as file:
        for at, frame in sorted(frames, key=lambda one: one[0]):
            file.write(frame, round((BEGIN_S + at) * 1e6))
    return path


def heartbeat(mode: int, autopilot: int = ARDUPILOT, kind: int = PLANE) -> dialect.MAVLink_message:
    return dialect.MAVLink_heartbeat_message(kind, autopilot, 1, mode, 4, 3)


def attitude(boot_ms: int, roll: float = 0.1) -> dialect.MAVLink_message:
    return dialect.MAVLink_attitude_message(boot_ms, roll, 0.02, 3.0, 0.01, 0.02, 0.03)


def plane(boot_s: float = 50.0, seconds: float = 10.0, late: float = 0.0) -> list[Timed]:
    """An ArduPlane's telemetry: attitude at 10 Hz, others slower."""
    sent: list[Timed] = []
    for k in range(int(seconds * 10)):
        at, boot_ms = late + 0.1 * k, round((boot_s + 0.1 * k) * 1e3)
        unix_us = round((BEGIN_S + 0.1 * k) * 1e6)
        sent.append((at, attitude(boot_ms, 0.01 * k)))
        if k % 2 == 0:
            sent += [
                (at, dialect.MAVLink_vfr_hud_message(20.0 + k, 21.0, 0, 55, 600.0, 0.0)),
                (
                    at,
                    dialect.MAVLink_servo_output_raw_message(
                        boot_ms * 1000 % 2**32, 0, 1500, 1600, 1700, 0, 0, 0, 0, 0
                    ),
                ),
                (
                    at,
                    dialect.MAVLink_nav_controller_output_message(
                        9.0, -3.0, 0, 0, 0, 5.0, -200.0, 1.0
                    ),
                ),
                (at, dialect.MAVLink_raw_imu_message(unix_us, 0, 0, -1000, 0, 0, 0, 200, 0, 0)),
                (
                    at,
                    dialect.MAVLink_gps_raw_int_message(
                        unix_us, 3, -350000000, 1490000000, 584000, 1, 1, 2000, 9000, 8
                    ),
                ),
            ]
        if k % 10 == 0:
            sent.append((at, heartbeat(10 if k < 50 else 5)))
    return sent


def test_channels_have_our_names_units_and_signs(tmp_path: Path) -> None:
    flight = read_flight(written(tmp_path / "a.tlog", (1, plane())))
    assert flight.kind == "tlog"
    last = {name: one.values[-1] for name, one in flight.channels.items()}
    assert last["roll"] == pytest.approx(0.99)
    assert last["r"] == pytest.approx(0.03)
    assert last["indicated_airspeed"] == pytest.approx(118.0)
    assert last["share_throttle"] == pytest.approx(0.55)
    assert last["output_2"] == 1600.0
    assert "output_4" not in flight
    assert last["reference_roll"] == pytest.approx(np.radians(9.0))
    assert last["error_height"] == pytest.approx(-5.0)  # measured minus commanded
    assert last["error_airspeed"] == pytest.approx(2.0)  # ArduPilot sends it in cm/s
    assert last["specific_force_z"] == pytest.approx(-9.80665)
    assert last["magnetic_x"] == pytest.approx(0.2)
    assert last["gnss_latitude"] == pytest.approx(-35.0)
    assert last["gnss_v_east"] == pytest.approx(20.0)
    assert flight.modes[0] == (0.0, "AUTO")
    assert flight.modes[1][0] == pytest.approx(5.0)
    assert flight.modes[1][1] == "FBWA"
    assert flight.started is not None
    assert flight.started.timestamp() == pytest.approx(BEGIN_S)


def test_clocks_are_aligned_however_late_the_link_is(tmp_path: Path) -> None:
    """Times since boot, since 1970, of 32 bits and of reception are one."""
    near_the_end_s = 2**32 / 1e6 - 4.0  # of the time of SERVO_OUTPUT_RAW [s]
    flight = read_flight(written(tmp_path / "a.tlog", (1, plane(near_the_end_s, late=7.0))))
    expected = np.arange(0.0, 10.0, 0.1)
    assert flight["roll"].time_s == pytest.approx(expected, abs=2e-3)
    for name in ("output_1", "gnss_latitude", "specific_force_x", "indicated_airspeed"):
        assert flight[name].time_s == pytest.approx(expected[::2], abs=2e-3), name
    assert flight["output_1"].clock == "boot"
    assert flight["indicated_airspeed"].clock == "heard"


def test_our_fleet_is_by_simulated_time_and_one_vehicle_is_chosen() -> None:
    flight = read_flight(DATA / "dashboard" / "flight.tlog", uav=2)
    assert flight["V"].rate_hz == pytest.approx(5.0, rel=0.05)
    assert flight["roll"].clock == "simulated"
    assert flight.end_s == pytest.approx(23.9, abs=0.1)
    error = flight["roll"].values - flight["reference_roll"].at(flight["roll"].time_s)
    known = np.isfinite(error)
    logged = flight["error_roll"].at(flight["roll"].time_s[known])
    assert error[known] == pytest.approx(logged, abs=2e-3)
    assert "of UAV 2; it has 1, 3, too (--uav)" in flight.remarks
    with pytest.raises(BadInput, match="--uav is 9, expected one of 1, 2, 3"):
        read_flight(DATA / "dashboard" / "flight.tlog", uav=9)


def test_mavlink_1_is_read_as_well() -> None:
    flight = read_flight(DATA / "others" / "mavlink1.tlog")
    assert len(flight["roll"].values) == 100
    assert flight["yaw"].values[0] == pytest.approx(0.5)
    assert flight.modes == ((0.0, "AUTO"),)


def test_a_vehicle_that_was_restarted_is_told(tmp_path: Path) -> None:
    first, second = plane(50.0, 3.0), plane(2.0, 8.0, late=20.0)
    first.append((1.0, dialect.MAVLink_statustext_message(4, b"of the first")))
    flight = read_flight(written(tmp_path / "a.tlog", (1, first + second)))
    assert flight.texts == ()
    assert flight.modes == ((0.0, "AUTO"), (pytest.approx(5.0), "FBWA"))
    assert flight.duration_s == pytest.approx(7.9, abs=0.05)
    assert flight["indicated_airspeed"].values[0] == 20.0
    assert any("the clock jumps by -50" in one for one in flight.remarks)


def test_a_log_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tlog", (1, plane()))
    path.write_bytes(path.read_bytes()[:-7])
    flight = read_flight(path)
    assert flight.duration_s == pytest.approx(9.8, abs=0.11)
    assert any("frames are read: " in one and "cut off" in one for one in flight.remarks)


def test_a_time_of_reception_that_is_no_date_is_none(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tlog", (1, plane()))
    data = bytearray(path.read_bytes())
    data[:8] = b"\xff" * 8
    path.write_bytes(data)
    assert read_flight(path).duration_s == pytest.approx(9.9)


def test_damaged_and_unknown_frames_are_counted(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tlog", (1, plane()))
    data = bytearray(path.read_bytes())
    data[8 + 12] ^= 1  # in the payload of the first frame
    path.write_bytes(data)
    flight = read_flight(path)
    assert len(flight["roll"].values) == 99
    assert any("1 of " in one and "have a wrong checksum" in one for one in flight.remarks)


def test_texts_in_pieces_are_whole(tmp_path: Path) -> None:
    said: list[Timed] = [
        (2.0, dialect.MAVLink_statustext_message(4, b"x" * 50, 7, 0)),
        (2.1, dialect.MAVLink_statustext_message(4, b"yz", 7, 1)),
        (3.0, dialect.MAVLink_statustext_message(6, b"ready")),
    ]
    flight = read_flight(written(tmp_path / "a.tlog", (1, plane() + said)))
    assert [(one.severity, one.text) for one in flight.texts] == [
        (4, "x" * 50 + "yz"),
        (6, "ready"),
    ]
    assert flight.texts[1].time_s == pytest.approx(3.0, abs=0.01)


def test_parameters(tmp_path: Path) -> None:
    bits = float(np.array([7], "<i4").view("<f4")[0])
    of_px4 = [
        (0.0, heartbeat(0, dialect.MAV_AUTOPILOT_PX4)),
        (0.1, dialect.MAVLink_param_value_message(b"WHOLE", bits, 6, 2, 0)),
        (0.2, dialect.MAVLink_param_value_message(b"REAL", 1.5, 9, 2, 1)),
        *((0.1 * k, attitude(100 * k)) for k in range(30)),
    ]
    flight = read_flight(written(tmp_path / "a.tlog", (1, of_px4)))
    assert flight.parameters == {"WHOLE": 7.0, "REAL": 1.5}


def test_a_log_of_stations_or_without_a_flight_is_refused(tmp_path: Path) -> None:
    station = [(0.1 * k, heartbeat(0, 8, dialect.MAV_TYPE_GCS)) for k in range(9)]
    with pytest.raises(BadInput, match="ground stations only"):
        read_flight(written(tmp_path / "a.tlog", (255, station)))
    silent = [(0.1 * k, heartbeat(0)) for k in range(9)]
    with pytest.raises(BadInput, match="system 1 sent nothing of a flight"):
        read_flight(written(tmp_path / "b.tlog", (1, silent), (255, station)))

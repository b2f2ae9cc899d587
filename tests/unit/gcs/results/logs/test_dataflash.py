"""Logs of ArduPilot."""

from pathlib import Path

import numpy as np
import pytest
from dataflash_writer import DataflashWriter

from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight

BOOT_US = 5_000_000


def described() -> DataflashWriter:
    log = DataflashWriter()
    log.define("ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw")
    log.define("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    log.define("GPS", "QBBIHLLefff", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ")
    log.define("ARSP", "QBff", "TimeUS,I,Airspeed,DiffPress")
    log.define("RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4")
    log.define("AETR", "Qffff", "TimeUS,Ail,Elev,Thr,Rudd")
    log.define("PARM", "QNf", "TimeUS,Name,Value")
    log.define("MODE", "QBBB", "TimeUS,Mode,ModeNum,Rsn")
    log.define("MSG", "QZ", "TimeUS,Message")
    log.define("ERR", "QBB", "TimeUS,Subsys,ECode")
    return log


def fly(log: DataflashWriter, seconds: float = 10.0, begin_us: int = BOOT_US) -> DataflashWriter:
    """Append a flight: rates at 50 Hz, attitude and outputs at 25 Hz, GNSS at 5 Hz."""
    for k in range(int(seconds * 50)):
        at = begin_us + k * 20_000
        log.add("IMU", at, 0, 0.01 * k, -0.2, 0.3, 0.0, 0.5, -9.8)
        log.add("IMU", at, 1, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0)  # the second one
        if k % 2 == 0:
            log.add("ATT", at, 1000, 900, -200, -300, 35900, 35500)
            log.add("ARSP", at, 0, 20.0, 245.0)
            log.add("RCOU", at, 1500, 1600, 0, 1450)
            log.add("AETR", at, 2250.0, -4500.0, 60.0, 450.0)
        if k % 10 == 0:
            status = 1 if k < 50 else 3  # no fix in the first second
            week = (0, 2300)[status > 2]
            place = -350_000_000, 1_490_000_000, 58_400
            log.add("GPS", at, 0, status, 1000 + 20 * k, week, *place, 12.0, 90.0, -0.5)
    return log


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "00000042.BIN"


def test_channels_have_our_names_and_units(path: Path) -> None:
    log = described()
    log.add("MODE", BOOT_US, 10, 10, 1)
    flight = read_flight(fly(log).save(path))
    assert flight.kind == "bin"
    assert flight.duration_s == pytest.approx(9.98)
    values = {name: one.values[-1] for name, one in flight.channels.items()}
    assert values["p"] == pytest.approx(4.99)  # of the first IMU
    assert values["specific_force_z"] == pytest.approx(-9.8)
    assert values["roll"] == pytest.approx(np.radians(9.0))
    assert values["reference_roll"] == pytest.approx(np.radians(10.0))
    assert values["yaw"] == pytest.approx(np.radians(-5.0))
    assert values["indicated_airspeed"] == 20.0
    assert values["dynamic_pressure"] == 245.0
    assert values["gnss_latitude"] == pytest.approx(-35.0)
    assert values["gnss_altitude"] == pytest.approx(584.0)
    assert values["gnss_v_east"] == pytest.approx(12.0)
    assert values["gnss_v_north"] == pytest.approx(0.0, abs=1e-5)
    assert values["gnss_v_down"] == -0.5
    assert values["output_2"] == 1600.0
    assert "output_3" not in flight  # 0: it has no output there
    assert values["share_aileron"] == pytest.approx(0.5)
    assert values["share_elevator"] == pytest.approx(-1.0)
    assert values["share_throttle"] == pytest.approx(0.6)
    assert values["share_rudder"] == pytest.approx(0.1)
    assert flight["p"].rate_hz == pytest.approx(50.0)
    assert flight["roll"].rate_hz == pytest.approx(25.0)
    assert flight["gnss_latitude"].time_s[0] == pytest.approx(1.0)  # without a fix there is none
    assert {one.clock for one in flight.channels.values()} == {"boot"}


def test_modes_texts_parameters_and_the_date(path: Path) -> None:
    log = described()
    log.add("PARM", BOOT_US, b"SERVO1_MIN", 1100.0)
    log.add("MSG", BOOT_US, b"ArduPlane V4.6.0 (x)")
    log.add("MODE", BOOT_US, 10, 10, 1)
    fly(log)
    log.add("MODE", BOOT_US + 4_000_000, 5, 5, 1)
    log.add("ERR", BOOT_US + 5_000_000, 11, 2)
    flight = read_flight(log.save(path))
    assert flight.modes == ((0.0, "AUTO"), (4.0, "FBWA"))
    assert [(one.time_s, one.text) for one in flight.texts] == [
        (0.0, "ArduPlane V4.6.0 (x)"),
        (5.0, "error 2 of subsystem 11"),
    ]
    assert flight.parameters == {"SERVO1_MIN": 1100.0}
    assert flight.started is not None
    # week 2300 of GPS began on 2024-02-04; the first fix is at 2 s of it, 1 s after the start
    assert flight.started.isoformat() == "2024-02-03T23:59:43+00:00"


def test_a_log_that_is_cut_off_is_read_up_to_there(path: Path) -> None:
    flight = read_flight(fly(described()).save(path, keep=0.5))
    assert 4.0 < flight.duration_s < 6.0
    assert flight["p"].values[0] == 0.0


def test_bytes_that_are_no_message_are_told(path: Path) -> None:
    fly(described()).save(path)
    data = bytearray(path.read_bytes())
    place = data.index(b"\xa3\x95", len(data) // 2)
    path.write_bytes(data[:place] + b"\0" * 700 + data[place:])
    flight = read_flight(path)
    assert flight.duration_s == pytest.approx(9.98)
    assert any("bytes between its messages are none" in one for one in flight.remarks)


@pytest.mark.parametrize(
    ("whole", "damaged"),
    [
        (b"TimeUS,Message", b"TimeUS,TimeUS\0"),  # two fields of one name
        (b"TimeUS,Mode,", b"TimeUS,,ode,"),  # one without a name
        (b"TimeUS,Subsys", b"TimeXX,Subsys"),  # no time
        (b"\x00\x00\x00\x3f", b"\x01\x00\xa0\x7f"),  # no number: a signalling NaN
    ],
)
def test_what_is_damaged_does_not_reach_the_rest(whole: bytes, damaged: bytes, path: Path) -> None:
    log = described()
    log.add("MSG", BOOT_US, b"ArduPlane V4.6.0 (x)")
    log.add("MODE", BOOT_US, 10, 10, 1)
    log.add("ERR", BOOT_US, 11, 2)
    fly(log).save(path)
    data = path.read_bytes()
    assert whole in data
    path.write_bytes(data.replace(whole, damaged))
    flight = read_flight(path)
    assert flight.duration_s == pytest.approx(9.98)
    assert len(flight["p"].values) >= 499


def test_a_second_boot_in_a_log_is_told(path: Path) -> None:
    log = described()
    log.add("MODE", 91_000_000, 0, 0, 1)
    fly(log, 3.0, 90_000_000)
    log.add("MODE", BOOT_US + 1_000_000, 10, 10, 1)
    flight = read_flight(fly(log, 8.0).save(path))
    assert flight.duration_s == pytest.approx(7.98, abs=0.03)
    assert any("the clock jumps by -8" in one for one in flight.remarks)
    assert flight.modes == ((1.0, "AUTO"),)  # and not by hand, as in the first one
    assert flight.started is not None
    assert flight.started.isoformat() == "2024-02-03T23:59:43+00:00"


def test_a_log_without_a_flight_is_refused(path: Path) -> None:
    log = described()
    log.add("PARM", BOOT_US, b"SERVO1_MIN", 1100.0)
    with pytest.raises(BadInput, match="no message of a flight, such as ATT"):
        read_flight(log.save(path))


def test_a_log_of_one_value_a_second_says_what_is_not_in_it(path: Path) -> None:
    log = described()
    for k in range(20):
        log.add("ATT", BOOT_US + k * 1_000_000, 0, 100 * k, 0, 0, 0, 0)
    remarks = read_flight(log.save(path)).remarks
    assert any("no rates (p, q, r)" in one for one in remarks)
    assert any("at 1 Hz: motions faster than 2 s are not in it" in one for one in remarks)

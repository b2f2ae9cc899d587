"""Logs of PX4, and our own exports, which read back are the recording."""

import io
from pathlib import Path

import numpy as np
import pytest

from gcs.console import extras
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_steps
from gcs.results.choices import Format, Record
from gcs.results.export import convert
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.logs.read import read_flight
from gcs.results.recorder import FlightRecorder
from gcs.results.ulog_file import Level, Topic, UlogWriter, text_message
from gcs.scenario.model import Scenario, scenario_of

SAME = ["north", "east", "down", "p", "q", "r", "roll", "pitch", "yaw", "V"]
SAME += [f"reference_{name}" for name in ("airspeed", "roll", "pitch", "yaw")]
SAME += [f"applied_{name}" for name in ("aileron", "elevator", "rudder", "throttle")]
HELD = [f"held_{name}" for name in ("aileron", "elevator", "rudder", "throttle")]


@pytest.fixture(scope="module")
def run(scenario1: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    fault = {"uav": 2, "actuator": "rudder", "effectiveness": 0.5, "start_s": 0.2}
    tree = scenario1.model_dump() | {"duration_s": 2.5, "faults": [fault]}
    tree["sensors"]["airspeed_m_s"]["noise_rms"] = 0.3  # measured is not true
    scenario = scenario_of("x", tree)
    with marked(folder, scenario, FlightMark.of("fly", "x", scenario)):
        recorder = FlightRecorder(scenario, folder, Record.LIGHT)
        recorder.finish(fly_in_steps(scenario, recorder.add))
    convert(folder, Format.ULG, folder)
    return folder


@pytest.mark.parametrize("uav", [1, 2, 3])
def test_what_we_exported_is_what_was_recorded(run: Path, uav: int) -> None:
    recorded, exported = read_flight(run, uav), read_flight(run / f"uav{uav}.ulg")
    for name in SAME:
        ours, theirs = recorded[name], exported[name]
        assert theirs.time_s == pytest.approx(ours.time_s, abs=1e-6), name
        assert theirs.values == pytest.approx(ours.values, abs=1e-7, rel=1e-6), name
        assert theirs.unit == ours.unit
    for name in HELD:
        ours = recorded[name]
        sent = exported[name]
        assert sent.by_event
        held = sent.at(ours.time_s)
        assert held[1:] == pytest.approx(ours.values[1:], abs=1e-7, rel=1e-6), name
    assert {one.clock for one in exported.channels.values()} == {"simulated"}
    assert ("fault: rudder at 50 %" in " ".join(one.text for one in exported.texts)) == (uav == 2)
    assert len(exported.parameters) > 50


FIELDS = {
    "vehicle_attitude": [("q", "float", 4)],
    "sensor_combined": [("gyro_rad", "float", 3), ("accelerometer_m_s2", "float", 3)],
    "vehicle_gps_position": [
        ("time_utc_usec", "uint64_t", 1),
        ("lat", "int32_t", 1),
        ("lon", "int32_t", 1),
        ("alt", "int32_t", 1),
        ("vel_n_m_s", "float", 1),
        ("fix_type", "uint8_t", 1),
    ],
    "airspeed_validated": [("true_airspeed_m_s", "float", 1)],
    "airspeed": [("true_airspeed_m_s", "float", 1)],
    "actuator_outputs": [("noutputs", "uint32_t", 1), ("output", "float", 16)],
    "vehicle_status": [("nav_state", "uint8_t", 1)],
}


def px4_log(path: Path, times_us: np.ndarray, keep: float = 1.0) -> Path:
    """A log as PX4's, all topics at the same times."""
    topics = {name: Topic(name, k, fields) for k, (name, fields) in enumerate(FIELDS.items())}
    made = {name: topic.messages(times_us) for name, topic in topics.items()}
    half = np.sqrt(0.5)
    made["vehicle_attitude"]["q"] = (half, half, 0.0, 0.0)  # 90° of roll
    made["sensor_combined"]["gyro_rad"] = (0.1, 0.2, 0.3)
    made["sensor_combined"]["accelerometer_m_s2"] = (0.0, 0.0, -9.8)
    gnss = made["vehicle_gps_position"]
    gnss["time_utc_usec"] = 1_700_000_000_000_000 + times_us
    gnss["lat"], gnss["lon"], gnss["alt"] = 470_000_000, 80_000_000, 500_000
    gnss["vel_n_m_s"], gnss["fix_type"] = 12.0, np.where(np.arange(len(times_us)) < 5, 1, 3)
    made["airspeed_validated"]["true_airspeed_m_s"] = 15.0
    made["airspeed"]["true_airspeed_m_s"] = 99.0
    made["actuator_outputs"]["output"] = 0.0
    made["actuator_outputs"]["output"][:, 1] = 1600.0
    made["actuator_outputs"]["output"][:, 4] = 900.0
    made["actuator_outputs"]["noutputs"] = 4
    made["vehicle_status"]["nav_state"] = np.where(np.arange(len(times_us)) < 10, 0, 5)
    file = io.BytesIO()
    writer = UlogWriter(
        file, int(times_us[0]), {"sys_name": "PX4"}, {"A": 1}, list(topics.values())
    )
    for k, at in enumerate(times_us.tolist()):
        writer.add(b"".join(messages[k].tobytes() for messages in made.values()))
        if k == 3:
            writer.add(text_message(at, Level.WARNING, "Low battery"))
    path.write_bytes(file.getvalue()[: int(len(file.getvalue()) * keep)])
    return path


TIMES = 8_000_000 + 20_000 * np.arange(200)


def test_channels_of_px4_have_our_names_and_units(tmp_path: Path) -> None:
    flight = read_flight(px4_log(tmp_path / "a.ulg", TIMES))
    assert flight["roll"].values[0] == pytest.approx(np.pi / 2.0)
    assert flight["q"].values[0] == pytest.approx(0.2)
    assert flight["specific_force_z"].values[0] == pytest.approx(-9.8)
    assert flight["V"].values[0] == 15.0  # PX4 has judged it; the sensor may not
    assert flight["gnss_latitude"].values[0] == pytest.approx(47.0)
    assert flight["gnss_altitude"].values[0] == pytest.approx(500.0)
    assert flight["gnss_v_north"].values[0] == 12.0
    assert flight["gnss_latitude"].time_s[0] == pytest.approx(0.1)
    assert flight["output_2"].values[0] == 1600.0
    assert "output_1" not in flight  # no pulse
    assert "output_5" not in flight  # no output
    assert flight.duration_s == pytest.approx(3.98)
    assert flight["roll"].rate_hz == pytest.approx(50.0)
    assert flight.modes == ((0.0, "MANUAL"), (pytest.approx(0.2), "AUTO_RTL"))
    assert [(one.severity, one.text) for one in flight.texts] == [(4, "Low battery")]
    assert flight.parameters == {"A": 1.0}
    assert flight.started is not None
    assert flight.started.timestamp() == pytest.approx(1_700_000_008.0)


def test_a_log_with_the_name_of_another_kind_is_read(tmp_path: Path) -> None:
    assert read_flight(px4_log(tmp_path / "a.tlog", TIMES[:9])).kind == "ulg"


def test_a_torn_recording_is_read_up_to_its_tear(run: Path, tmp_path: Path) -> None:
    whole = (run / "trajectory.arrows").read_bytes()
    torn = tmp_path / "trajectory.arrows"
    torn.write_bytes(whole[:-4])  # the end, and no rows: they are of one batch
    flight = read_flight(torn, uav=2)
    assert flight.end_s == read_flight(run, uav=2).end_s
    assert "the recording is torn: what was recorded before is read" in flight.remarks


def test_a_gap_of_the_logger_is_one_of_its_channels(tmp_path: Path) -> None:
    times = np.where(np.arange(200) < 100, TIMES, TIMES + 2_000_000)
    flight = read_flight(px4_log(tmp_path / "a.ulg", times))
    assert np.array(flight["p"].gaps) == pytest.approx(np.array([[1.98, 4.0]]))


def test_a_clock_that_goes_back_is_told(tmp_path: Path) -> None:
    times = np.where(np.arange(200) < 50, TIMES + 60_000_000, TIMES)
    flight = read_flight(px4_log(tmp_path / "a.ulg", times))
    assert any("the clock jumps by -" in one for one in flight.remarks)
    assert flight.duration_s == pytest.approx(2.98)


def test_a_damaged_time_or_number_does_not_reach_the_others(tmp_path: Path) -> None:
    path = px4_log(tmp_path / "a.ulg", TIMES)
    data = bytearray(path.read_bytes())
    at = int(TIMES[70]).to_bytes(8, "little")
    places = [k for k in range(len(data)) if data.startswith(at, k)]
    assert len(places) == len(FIELDS)
    for topic in ("vehicle_status", "airspeed"):
        place = places[list(FIELDS).index(topic)]
        data[place + 5] = 7  # 90 days later
    data[places[list(FIELDS).index("actuator_outputs")] + 8 + 1] = 9  # thousands of outputs
    data[data.index(b"Low battery") - 9] = 0xFF  # of no level
    path.write_bytes(data)
    flight = read_flight(path)
    assert flight.duration_s == pytest.approx(3.98)
    assert "output_2" in flight
    assert [one.severity for one in flight.texts] == [7]


def test_a_log_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    flight = read_flight(px4_log(tmp_path / "a.ulg", TIMES, keep=0.6))
    assert 1.5 < flight.duration_s < 3.0


def test_without_pyulog_it_says_what_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = px4_log(tmp_path / "a.ulg", TIMES[:3])
    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"a\.ulg, a ULog file, needs pyulog") as refused:
        read_flight(path)
    assert "extra `logs`" in refused.value.hint

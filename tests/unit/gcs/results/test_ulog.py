"""ULog files, read back by PX4's own library and commands, are the recording."""

import math
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyulog import ULog
from pyulog.px4 import PX4ULog

from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_steps
from gcs.results.choices import Format, Record
from gcs.results.export import convert
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.recorder import FlightRecorder
from gcs.results.run_folder import read_summary
from gcs.results.ulog_topics import TOPICS
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.constants import ACTUATORS

PATH = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
WIND = {"north_m_s": 3.0, "east_m_s": -2.0}
FAULTS = [
    {"uav": 2, "actuator": "rudder", "effectiveness": 0.5, "start_s": 0.2, "end_s": 0.4},
    {"uav": 2, "actuator": "aileron", "effectiveness": 0.5, "start_s": 5.0},
]


def flown(scenario1: Scenario, folder: Path, record: Record) -> Path:
    tree = scenario1.model_dump() | {"duration_s": 0.6, "faults": FAULTS, "name": "Türn"}
    tree["wind"]["steady"] = WIND
    scenario = scenario_of("x", tree)
    with marked(folder, scenario, FlightMark.of("fly", "x", scenario)):
        recorder = FlightRecorder(scenario, folder, record)
        recorder.finish(fly_in_steps(scenario, recorder.add))
    return folder


@pytest.fixture(scope="module")
def full(scenario1: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = flown(scenario1, tmp_path_factory.mktemp("full"), Record.FULL)
    convert(folder, Format.ULG, folder)
    return folder


@pytest.fixture(scope="module")
def log(full: Path) -> Any:
    return ULog(str(full / "uav2.ulg"))


def command(name: str) -> str:
    found = shutil.which(name, path=PATH)
    assert found is not None, f"pyulog's {name} is not installed"
    return found


def columns(folder: Path, name: str, system: int = 2) -> dict[str, np.ndarray]:
    table = pa.ipc.open_stream((folder / f"{name}.arrows").read_bytes()).read_all()
    own = np.asarray(table.column("uav")) == system
    return {
        column: np.array(table.column(column).to_pylist())[own] for column in table.column_names
    }


def topic(log: Any, name: str) -> dict[str, np.ndarray]:
    data: dict[str, np.ndarray] = log.get_dataset(name).data
    return data


def test_every_uav_has_a_file_without_damage(full: Path) -> None:
    for system in (1, 2, 3):
        log = ULog(str(full / f"uav{system}.ulg"), disable_str_exceptions=False)
        assert not log.file_corruption
        assert not log.dropouts
        assert {one.name for one in log.data_list} == set(TOPICS)
        assert log.msg_info_dict["vehicle"].startswith(f"UAV {system}, ")


def test_attitude_and_its_setpoint_are_the_recording_s(full: Path, log: Any) -> None:
    PX4ULog(log).add_roll_pitch_yaw()  # its own way from quaternions to angles
    recorded = columns(full, "trajectory")
    attitude, setpoint = topic(log, "vehicle_attitude"), topic(log, "vehicle_attitude_setpoint")
    for name in ("roll", "pitch", "yaw"):
        assert attitude[name] == pytest.approx(recorded[name], abs=1e-6)
        assert setpoint[f"{name}_d"] == pytest.approx(recorded[f"reference_{name}"], abs=1e-6)
    assert attitude["timestamp"] == pytest.approx(recorded["time_s"] * 1e6)
    rates = topic(log, "vehicle_rates_setpoint")
    for name, axis in (("roll", "p"), ("pitch", "q"), ("yaw", "r")):
        assert rates[name] == pytest.approx(recorded[f"omega_d_{axis}"], rel=1e-6, nan_ok=True)
    turning = topic(log, "vehicle_angular_velocity")
    assert turning["xyz[1]"] == pytest.approx(recorded["q"], rel=1e-6)


def test_positions_and_speeds_agree_with_each_other(full: Path, log: Any) -> None:
    recorded = columns(full, "trajectory")
    local, place = topic(log, "vehicle_local_position"), topic(log, "vehicle_global_position")
    for field, name in zip("xyz", ("north", "east", "down"), strict=True):
        assert local[field] == pytest.approx(recorded[name], abs=1e-4)
        speed = np.gradient(recorded[name], recorded["time_s"])  # of the positions themselves
        assert local[f"v{field}"][1:-1] == pytest.approx(speed[1:-1], abs=2e-2)
    north = np.radians(place["lat"] - local["ref_lat"]) * 6378137.0
    assert north == pytest.approx(local["x"], abs=0.02)
    assert place["alt"] == pytest.approx(local["ref_alt"] - local["z"], abs=2e-3)
    wind = topic(log, "wind")
    assert wind["windspeed_north"] == pytest.approx(3.0, abs=1e-5)
    assert wind["windspeed_east"] == pytest.approx(-2.0, abs=1e-5)
    through_air = np.sqrt(sum((recorded[u] - recorded[f"wind_{u}"]) ** 2 for u in "uvw"))
    true = topic(log, "airspeed_validated")["true_airspeed_m_s"]
    assert true == pytest.approx(through_air, rel=1e-6)
    sought = topic(log, "tecs_status")["true_airspeed_sp"]
    assert sought == pytest.approx(recorded["reference_airspeed"], rel=1e-6)


def test_an_actuator_message_is_a_transmission(full: Path, log: Any, scenario1: Scenario) -> None:
    events = columns(full, "events")
    told = topic(log, "ftc_event")
    assert [ACTUATORS[k] for k in told["actuator"]] == events["actuator"].tolist()
    assert told["timestamp"] == pytest.approx(events["time_s"] * 1e6)
    is_thrust = events["actuator"] == "throttle"
    servos, motors = topic(log, "actuator_servos"), topic(log, "actuator_motors")
    assert len(servos["timestamp"]) == len(set(events["time_s"][~is_thrust]))
    assert len(motors["timestamp"]) == len(set(events["time_s"][is_thrust]))
    sent = {*servos["timestamp"].tolist(), *motors["timestamp"].tolist()}
    own = read_summary(full).uav(2)
    assert own is not None
    assert len(sent) == own.actuator_messages
    limits = scenario1.aircraft.fault_limits
    held = motors["control[0]"] * limits.thrust_n
    assert held == pytest.approx(events["value"][is_thrust], rel=1e-6)
    for k, name in enumerate(("aileron", "elevator", "rudder")):
        low, high = limits.surfaces_deg[ACTUATORS.index(name)]
        mask = events["actuator"] == name
        last = dict(zip(events["time_s"][mask].round(6), events["value"][mask], strict=True))
        control = dict(zip(servos["timestamp"] / 1e6, servos[f"control[{k}]"], strict=True))
        for at, value in last.items():
            stop = math.radians(high if value >= 0 else -low)
            assert control[at] == pytest.approx(value / stop, rel=1e-5, abs=1e-9)
    assert np.isnan(servos["control[3]"]).all()


def test_what_actuators_did_is_in_natural_units(full: Path, log: Any) -> None:
    recorded, outputs = columns(full, "trajectory"), topic(log, "actuator_outputs")
    for k, name in enumerate(ACTUATORS):
        applied = recorded[f"applied_{name}"]
        expected = applied if name == "throttle" else np.degrees(applied)
        assert outputs[f"output[{k}]"] == pytest.approx(expected, rel=1e-6)
    assert set(outputs["noutputs"]) == {4}


def test_what_happened_is_logged(log: Any) -> None:
    told = [(one.timestamp, one.log_level_str(), one.message) for one in log.logged_messages]
    assert told == [
        (200_000, "WARNING", "fault: rudder at 50 % in (0.2, 0.4] s"),
        (400_000, "INFO", "fault of rudder over"),
    ]  # the other one would have begun after the end


def test_information_and_parameters_are_there(log: Any) -> None:
    information = log.msg_info_dict
    assert information["sys_name"] == "ftc-sitl"
    assert information["time_ref_utc"] == 0
    assert information["scenario"] == "Türn"
    assert information["ver_sw"]
    assert log.get_version_info_str() == "v0.1.0"
    parameters = log.initial_parameters
    assert parameters["SYSID_THISMAV"] == 2
    assert parameters["MAV_TYPE"] == 1
    assert parameters["TRIG_B1"] == pytest.approx(0.01)  # Table III
    assert PX4ULog(log).get_mav_type() == "Fixed Wing"


def test_messages_come_in_the_order_of_time(full: Path) -> None:
    data = (full / "uav2.ulg").read_bytes()
    at, newest = 16, 0
    while at < len(data):
        size, kind = struct.unpack_from("<HB", data, at)
        offset = {ord("D"): 2, ord("L"): 1}.get(kind)
        if offset is not None:
            (time_us,) = struct.unpack_from("<Q", data, at + 3 + offset)
            assert time_us >= newest
            newest = time_us
        at += 3 + size
    assert at == len(data)


@pytest.mark.parametrize("tool", ["ulog_info", "ulog_messages", "ulog_params"])
def test_commands_of_pyulog_read_it(full: Path, tool: str) -> None:
    path = full / "uav2.ulg"
    done = subprocess.run([command(tool), path], capture_output=True, text=True, check=True)
    expected = {"ulog_info": "actuator_servos", "ulog_messages": "rudder", "ulog_params": "TRIG_"}
    assert expected[tool] in done.stdout
    assert "corrupt" not in done.stdout.lower() + done.stderr.lower()


def test_ulog2csv_has_a_row_for_each_recorded_step(full: Path, tmp_path: Path) -> None:
    path = full / "uav2.ulg"
    subprocess.run([command("ulog2csv"), "-o", tmp_path, path], capture_output=True, check=True)
    (attitude,) = tmp_path.glob("*_vehicle_attitude_0.csv")
    assert len(attitude.read_text().splitlines()) == 1 + 600


def test_a_light_recording_has_all_but_rates(scenario1: Scenario, tmp_path: Path) -> None:
    folder = flown(scenario1, tmp_path, Record.LIGHT)
    convert(folder, Format.ULG, folder)
    log = ULog(str(folder / "uav1.ulg"))
    assert set(TOPICS) - {one.name for one in log.data_list} == {"vehicle_rates_setpoint"}
    assert len(topic(log, "vehicle_attitude")["timestamp"]) == 30


def test_a_flight_that_was_interrupted_is_exported_up_to_there(
    scenario1: Scenario, tmp_path: Path
) -> None:
    folder = flown(scenario1, tmp_path, Record.LIGHT)
    for name in ("summary.json", "flight.yaml", "scenario.yaml"):
        (folder / name).unlink()
    for name, lost in (("trajectory.arrows", 8), ("events.arrows", 20)):  # the end, and a batch
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[:-lost])
    convert(folder, Format.ULG, folder)
    log = ULog(str(folder / "uav3.ulg"))
    assert not log.file_corruption
    assert "ver_sw" not in log.msg_info_dict
    assert log.logged_messages == []


def test_a_recording_of_an_earlier_version_is_refused(scenario1: Scenario, tmp_path: Path) -> None:
    folder = flown(scenario1, tmp_path, Record.LIGHT)
    path = folder / "trajectory.arrows"
    table = pa.ipc.open_stream(path.read_bytes()).read_all()
    metadata = {key: value for key, value in table.schema.metadata.items() if key != b"limits"}
    with pa.ipc.new_stream(path, table.schema.with_metadata(metadata)) as writer:
        writer.write_table(table.replace_schema_metadata(metadata))
    with pytest.raises(BadInput, match="an earlier version"):
        convert(folder, Format.ULG, folder)
    assert not list(folder.glob("*.ulg*"))


def test_formats_have_no_padding() -> None:
    """Fields from the largest to the smallest need none, and readers assume none."""
    sizes = {"uint64_t": 8, "double": 8, "float": 4, "uint32_t": 4, "uint16_t": 2}
    for one in TOPICS.values():
        fields = one.format.partition(":")[2].split(";")[:-1]
        assert fields[0] == "uint64_t timestamp"
        widths = [sizes.get(field.split()[0].partition("[")[0], 1) for field in fields]
        assert widths == sorted(widths, reverse=True)

"""Sensor faults of a scenario, and the bundled files."""

from typing import Any

import pytest

from gcs.fleet.in_process import add_faults
from gcs.scenario.bundled import bundled_names
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from mavlink_defs.config.models import ConfigError
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_FAULTS

FILES = [name for name in bundled_names() if name.startswith("sensor_faults/")]
OFF = {"uav": 3, "sensor": "gps", "failure": "off", "start_s": 1.0}


def scenario(*faults: dict[str, Any], **keys: Any) -> Scenario:
    tree = scenario_tree("paper/scenario1") | {"navigation": "estimated", "faults": [*faults]}
    return scenario_of("here.yaml", tree | keys)


def problems(*faults: dict[str, Any], **keys: Any) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        scenario(*faults, **keys)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize("name", FILES)
def test_every_file_has_a_sensor_fault_and_navigates_by_sensors(name: str) -> None:
    found = load_scenario(name)
    assert found.navigation == "estimated"
    assert found.faults
    assert not found.actuator_faults
    for _, fault in found.fault_commands():
        assert fault.family is SENSOR_FAULTS
        assert fault.start_s < found.duration_s


def test_there_are_files_for_every_sensor() -> None:
    sensors = {fault.target.name for name in FILES for _, fault in _faults(name)}
    assert len(sensors) == 6


def _faults(name: str) -> list[tuple[int, Fault]]:
    found = load_scenario(name).fault_commands()
    return [(uav, fault) for uav, fault in found if fault.family is SENSOR_FAULTS]


def test_faults_of_both_kinds_stand_side_by_side_and_survive_a_file() -> None:
    rudder = {"uav": 3, "actuator": "rudder", "effectiveness": 0.5, "start_s": 1.0}
    both = scenario(OFF, rudder)
    assert [f.target.name for f in both.faults] == ["gps", "rudder"]
    assert [f.actuator for f in both.actuator_faults] == ["rudder"]
    again = scenario_of("here.yaml", both.model_dump())
    assert again == both


@pytest.mark.parametrize(
    ("faults", "keys", "problem"),
    [
        (
            [OFF],
            {"navigation": "true_state"},
            "faults[0].sensor: with 'navigation: true_state' the aircraft has no gps that could "
            "fail; set 'navigation: estimated'",
        ),
        (
            [OFF | {"sensor": "gyro", "instance": 3}],
            {},
            "faults[0].instance: expected 0 to 2, as many as there are, got 3",
        ),
        (
            [OFF | {"sensor": "airspeed"}],
            {"sensors": {"navigation": {"pitot": {"fitted": False}}}},
            "faults[0].sensor: the aircraft has no airspeed: see sensors.navigation",
        ),
        (
            [OFF, OFF | {"failure": "stuck", "start_s": 2.0}],
            {},
            "faults[1]: overlaps faults[0]: the gps of UAV 3 has a fault in (1, ...) s already, "
            "got (2, ...) s",
        ),
        ([OFF | {"uav": 9}], {}, "faults[0].uav: expected one of the UAVs 1, 2, 3, got 9"),
        (
            [OFF | {"actuator": "rudder"}],
            {},
            "faults[0].actuator: unknown key",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused(
    faults: list[dict[str, Any]], keys: dict[str, Any], problem: str
) -> None:
    assert problems(*faults, **keys) == [problem]


def test_two_gyros_may_fail_one_after_the_other_but_not_both_and_one() -> None:
    gyro = OFF | {"sensor": "gyro"}
    scenario(gyro | {"instance": 1}, gyro | {"instance": 2, "failure": "stuck"})
    assert "overlaps" in problems(gyro, gyro | {"instance": 2})[0]


def test_as_many_as_fit_and_no_more() -> None:
    gyro = {"uav": 3, "sensor": "gyro", "failure": "off"}
    each = [gyro | {"start_s": 1.0 + i, "end_s": 1.5 + i} for i in range(16)]
    scenario(*each)  # two gyros: 32 rows
    assert problems(*each, gyro | {"start_s": 50.0}) == [
        "faults[16].uav: UAV 3 has more than 32 faults, as many as fit"
    ]


def test_actuators_are_not_handed_the_faults_of_sensors() -> None:
    from sitl_plant.loop.fleet import new_plant_state

    with_fault = scenario({"uav": 3, "actuator": "rudder", "effectiveness": 0.5, "start_s": 1.0})
    fleet = new_plant_state(with_fault.plant_config())
    add_faults(with_fault, fleet)
    assert [int(row["target"]) for row in fleet.uavs[2]["faults"] if row["target"] >= 0] == [2]


@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        ({"sensor": "gyro", "failure": "stuck"}, None),
        ({"sensor": "gps", "bias_m": 50.0, "axis": "x"}, None),
        (
            {"sensor": "gps", "bias_m": 50.0},
            "faults[0].sensor: ArduPlane's GPS and barometer share a position: expected bias or "
            "drift with axis x or y",
        ),
        (
            {"sensor": "magnetometer", "failure": "stuck"},
            "faults[0].sensor: ArduPlane makes its magnetometer itself; by JSON it gets gyro and "
            "accelerometer and gps and airspeed",
        ),
        (
            {"sensor": "airspeed", "failure": "off"},
            "faults[0].sensor: ArduPlane gets a value of the airspeed in each frame: it is never "
            "off",
        ),
        (
            {"sensor": "gyro", "failure": "stuck", "instance": 2},
            "faults[0].instance: expected 0 to 1, as many as there are, got 2",
        ),
    ],
)
def test_what_an_arduplane_is_shown_can_fail(fault: dict[str, Any], problem: str | None) -> None:
    uavs = scenario_tree("paper/scenario1")["uavs"]
    uavs[2]["autopilot"] = {"kind": "ardupilot", "binary": "arduplane"}
    keys = {"uavs": uavs, "navigation": "true_state"}
    one = {"uav": 3, "start_s": 1.0} | fault
    if problem is None:
        scenario(one, **keys)
        assert "true_state" in problems(one | {"uav": 1}, **keys)[0], "ours has no such sensor"
    else:
        assert problems(one, **keys) == [problem]


def test_all_sensors_of_a_px4_can_fail() -> None:
    uavs = scenario_tree("paper/scenario1")["uavs"]
    uavs[2]["autopilot"] = {"kind": "px4", "binary": "px4"}
    for sensor in ("gyro", "accelerometer", "magnetometer", "barometer", "gps", "airspeed"):
        scenario(OFF | {"sensor": sensor}, uavs=uavs, navigation="true_state")

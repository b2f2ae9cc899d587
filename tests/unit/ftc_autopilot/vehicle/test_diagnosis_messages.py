"""What stations hear of a vehicle's diagnosis of its own actuators."""

import math
from typing import Any

import numpy as np
import pytest
from vehicle_bench import UAV, Bench, of_type

from ftc_autopilot.control.controllers import reset_controllers
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs import dialect
from mavlink_defs.config.inherit import merged

MOTORS = dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    tree = scenario1.model_dump() | {"controller": {"kind": "surviving"}}
    return Bench(Scenario.model_validate(tree))


def diagnosed(bench: Bench) -> Any:
    """The diagnosis of the bench's vehicle, as if its law had run for 20 s."""
    diagnosis = bench.controllers.uavs[0]["controller"]["surviving"]["diagnosis"]
    diagnosis["age"] = 20.0
    bench.hot.measured["time_usec"] = 20_000_000
    bench.run()
    return diagnosis


def said(bench: Bench) -> list[tuple[int, str]]:
    """Severities and texts of what the vehicle says at its next timer."""
    bench.now += 0.01
    bench.vehicle.handle_timer(bench.now)
    chunks = of_type(bench.vehicle.gcs_messages(), "STATUSTEXT")
    texts: dict[int, tuple[int, str]] = {}
    for chunk in chunks:
        before = texts.get(chunk.id, (chunk.severity, ""))[1]
        texts[chunk.id] = (chunk.severity, before + chunk.text)
    return list(texts.values())


@pytest.mark.parametrize(
    ("channel", "stuck", "reported"),
    [
        (0, math.radians(0.1), "aileron lost at 19.94 s, held at 0.1 deg, roll by rudder, heading"),
        (1, math.radians(-5), "elevator lost at 19.94 s, held at -5.0 deg, pitch by thrust"),
        (2, math.radians(15), "rudder lost at 19.94 s, held at 15.0 deg, roll by aileron"),
        (3, 500.0, "throttle lost at 19.94 s, held at 500 N, nothing replaces it"),
    ],
)
def test_a_loss_and_a_return_are_announced_once(
    bench: Bench, channel: int, stuck: float, reported: str
) -> None:
    actuator = diagnosed(bench)["actuators"][channel]
    said(bench)
    actuator["lost"], actuator["stuck"], actuator["decided_s"] = 1, stuck, 0.06
    ((severity, text),) = said(bench)
    assert severity == dialect.MAV_SEVERITY_CRITICAL
    assert text.startswith(reported)
    assert said(bench) == []
    bench.hot.measured["time_usec"] += 1_000_000
    actuator["lost"], actuator["decided_s"] = 0, 0.25
    ((severity, text),) = said(bench)
    assert (severity, text) == (
        dialect.MAV_SEVERITY_NOTICE,
        f"{reported.split(maxsplit=1)[0]} back in service at 20.75 s",
    )


def test_a_new_flight_is_no_return_to_service(bench: Bench) -> None:
    actuator = diagnosed(bench)["actuators"][0]
    said(bench)
    actuator["lost"] = 1
    assert len(said(bench)) == 1
    reset_controllers(bench.controllers)
    assert said(bench) == []


def test_health_and_phase_follow_the_diagnosis(bench: Bench) -> None:
    makers = bench.vehicle.telemetry[0]
    signals = bench.controllers.uavs[0]["signals"]
    signals["effectiveness"] = (1.0, 0.5, 1.0, 1.0)
    signals["offset"] = (*np.radians([0.0, -2.0, 7.0]), 50.0)
    signals["phase"] = (0, 1, 0, 0)
    status: Any = makers.make(dialect.MAVLINK_MSG_ID_SYS_STATUS)
    assert status.onboard_control_sensors_present & MOTORS
    assert status.onboard_control_sensors_health & MOTORS
    signals["phase"][2] = 2
    status = makers.make(dialect.MAVLINK_MSG_ID_SYS_STATUS)
    assert not status.onboard_control_sensors_health & MOTORS
    message: Any = makers.make(dialect.MAVLINK_MSG_ID_FTC_DIAGNOSIS)
    assert list(message.phase) == [0, 1, 2, 0]
    assert list(message.effectiveness) == [1.0, 0.5, 1.0, 1.0]
    assert list(message.offset) == pytest.approx([0.0, -2.0, 7.0, 50.0], abs=1e-5)


def test_a_law_without_diagnosis_says_that_it_knows_nothing(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    telemetry = bench.vehicle.telemetry[0]
    message: Any = telemetry.make(dialect.MAVLINK_MSG_ID_FTC_DIAGNOSIS)
    assert list(message.phase) == [dialect.FTC_PHASE_UNKNOWN] * 4
    assert all(map(math.isnan, (*message.effectiveness, *message.offset, *message.confidence)))
    status: Any = telemetry.make(dialect.MAVLINK_MSG_ID_SYS_STATUS)
    assert status.onboard_control_sensors_health & MOTORS


@pytest.mark.parametrize(
    ("name", "channel", "ending"),
    [
        ("airframes/skywalker_x8", 0, "nothing replaces it"),
        ("slipping", 0, "roll by rudder, heading by bank"),
        ("slipping", 2, "roll by aileron, heading by bank"),
    ],
)
def test_where_bank_holds_the_heading_it_is_not_given_up(
    name: str, channel: int, ending: str
) -> None:
    tree = scenario_tree("airframes/aerosonde" if name == "slipping" else name)
    if name == "slipping":
        tree = merged(tree, {"aircraft": {"coefficients": {"cY_dr": 1.2}}})
    tree = merged(tree, {"controller": {"kind": "surviving"}})
    bench = Bench(scenario_of(name, tree))
    actuator = diagnosed(bench)["actuators"][channel]
    said(bench)
    actuator["lost"], actuator["decided_s"] = 1, 0.06
    ((_, text),) = said(bench)
    assert text.endswith(f"held at 0.0 deg, {ending}")


@pytest.mark.parametrize(("name", "told"), [("skywalker_x8", True), ("aerosonde", False)])
def test_who_holds_the_heading_by_bank_says_so_when_it_is_armed(name: str, told: bool) -> None:
    tree = merged(scenario_tree(f"airframes/{name}"), {"controller": {"kind": "surviving"}})
    bench = Bench(scenario_of(name, tree))
    bench.run()
    said(bench)
    arm = dialect.MAV_CMD_COMPONENT_ARM_DISARM
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, arm, 0, 1, 0, 0, 0, 0, 0, 0))
    texts = [answer.text for answer in of_type(answers, "STATUSTEXT")]
    assert ("heading by bank: no rudder" in texts) is told

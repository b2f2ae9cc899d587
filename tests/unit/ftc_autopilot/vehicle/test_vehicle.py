"""The vehicle's services, message by message: no socket, no sleep."""

import math
from typing import Any

import numpy as np
import pytest
from vehicle_bench import ACCEPTED, ARM, DENIED, START, UAV, Bench, of_type

from ftc_autopilot.control.controllers import ReferenceSource
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, GUIDED, LOITER, SIMULATOR_COMPONENT
from mavlink_defs.framing.frames import FramePacker, parse


def test_arming_waits_for_the_simulator(scenario1: Scenario) -> None:
    bench = Bench(scenario1, heard=False)
    assert bench.command(ARM, 1.0) == dialect.MAV_RESULT_TEMPORARILY_REJECTED
    assert not bench.vehicle.modes.armed


def test_after_arming_it_circles_at_its_place_before_time_runs(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.hot.measured["position"] = (30.0, 20.0, -110.0)
    assert bench.command(ARM, 1.0) == ACCEPTED
    assert bench.vehicle.modes.mode == LOITER
    begin = bench.vehicle.modes.path.point()
    assert (begin.north, begin.east, begin.height) == (30.0, 20.0, 110.0)
    assert bench.controllers.uavs[0]["guidance"]["active"] == 1


def test_a_mission_cannot_start_without_a_profile(scenario1: Scenario) -> None:
    assert Bench(scenario1).command(START) == DENIED


def test_a_started_mission_flies_the_uploaded_profile(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    assert bench.upload(scenario1) == dialect.MAV_MISSION_ACCEPTED
    assert bench.command(START) == ACCEPTED
    guidance = bench.controllers.uavs[0]["guidance"]
    assert bench.vehicle.modes.mode == AUTO
    assert (guidance["follows"], guidance["start_step"]) == (ReferenceSource.PROFILE, 0)
    assert bench.controllers.uavs[0]["profile"]["count"] == 3


def test_a_mission_started_in_flight_begins_with_the_next_step(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(ARM, 1.0)
    bench.run()
    bench.hot.step = 500
    bench.command(START)
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 501


def test_a_mission_is_started_again_after_another_upload(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    for _ in range(2):
        bench.upload(scenario1)
        assert bench.command(START) == ACCEPTED
        assert bench.vehicle.modes.started
        bench.say(dialect.MAVLink_mission_clear_all_message(UAV, 1, 0))
        assert not bench.vehicle.modes.started


def test_mission_progress_follows_the_profile(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(START)
    bench.run()
    bench.hot.step = 4001
    bench.vehicle.handle_timer(bench.now)
    said = bench.vehicle.gcs_messages()
    assert [m.seq for m in of_type(said, "MISSION_ITEM_REACHED")] == [1]
    assert {m.seq for m in of_type(said, "MISSION_CURRENT")} == {2}
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 0


def test_setting_the_current_item_jumps_in_the_profile(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(START)
    bench.run()
    bench.hot.step = 1000
    bench.say(dialect.MAVLink_mission_set_current_message(UAV, 1, 3))
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 1000 - 15000
    bench.hot.step = 1001
    bench.vehicle.handle_timer(bench.now)
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 1000 - 15000
    assert not of_type(bench.vehicle.gcs_messages(), "MISSION_ITEM_REACHED")


def test_disarming_in_flight_must_be_forced(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.command(ARM, 1.0)
    bench.run()
    assert bench.command(ARM, 0.0) == DENIED
    assert bench.command(ARM, 0.0, 21196.0) == ACCEPTED
    assert bench.controllers.uavs[0]["guidance"]["active"] == 0


def test_arming_again_restarts_the_law(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.command(ARM, 1.0)
    bench.run()
    controller = bench.controllers.uavs[0]["controller"]
    controller["started"], controller["proposed"]["beta_v"] = 1, 5.0
    controller["steps"] = controller["events"][:] = 7
    bench.command(ARM, 1.0)  # is armed already
    assert controller["started"] == 1
    bench.command(ARM, 0.0, 21196.0)
    bench.command(ARM, 1.0)
    assert (controller["started"], controller["proposed"]["beta_v"]) == (0, 0.0)
    assert (controller["steps"], controller["events"].tolist()) == (7, [7] * 4)


def test_after_a_restart_of_the_plant_everything_is_as_before_the_flight(
    scenario1: Scenario,
) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(ARM, 1.0)
    bench.command(START)
    bench.run()
    bench.hot.step = 20_000
    bench.hot.edge_changes = 2
    bench.hot.edges[:] = 1
    bench.vehicle.handle_timer(bench.now)
    bench.vehicle.gcs_messages()
    bench.run(flags=0)
    bench.vehicle.restart()
    bench.vehicle.handle_timer(bench.now)
    said = bench.vehicle.gcs_messages()
    texts = [m.text for m in of_type(said, "STATUSTEXT")]
    assert texts == ["mode LOITER", "plant restarted: disarmed, arm to fly again"]
    (heartbeat,) = of_type(bench.vehicle.simulator_messages()[-1:], "HEARTBEAT")
    assert (heartbeat.custom_mode, heartbeat.system_status) == (
        LOITER,
        dialect.MAV_STATE_STANDBY,
    )
    assert not heartbeat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
    assert bench.controllers.uavs[0]["guidance"]["active"] == 0
    assert bench.command(START) == ACCEPTED  # the profile is still there, and begins again
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 0


@pytest.mark.parametrize("mode", [0.0, 5.0, 6.0, math.nan])
def test_other_modes_are_refused(mode: float, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    assert bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, mode) == DENIED
    assert bench.vehicle.modes.mode == LOITER


def test_guided_follows_set_points(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, GUIDED)
    half = math.radians(10.0) / 2.0
    q = [math.cos(half), math.sin(half), 0.0, 0.0]
    bench.say(dialect.MAVLink_set_attitude_target_message(0, UAV, 1, 0b111, q, 0, 0, 0, 0.0))
    assert bench.controllers.uavs[0]["guidance"]["command"][1] == pytest.approx(math.radians(10.0))
    assert bench.command(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 45.0) == ACCEPTED
    assert bench.controllers.uavs[0]["guidance"]["command"][0] == 45.0
    assert bench.command(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 450.0) == DENIED


@pytest.mark.parametrize(
    "number",
    [
        dialect.MAV_CMD_FTC_SET_FAULT,
        dialect.MAV_CMD_FTC_SET_SENSOR_FAULT,
        dialect.MAV_CMD_INJECT_FAILURE,
        dialect.MAV_CMD_FTC_CLEAR_FAULTS,
    ],
)
def test_fault_commands_go_to_the_simulator_unread_and_its_answer_comes_back(
    number: int, scenario1: Scenario
) -> None:
    bench = Bench(scenario1)
    params = (2.0, 0.9, 0.0, 0.0, math.nan, math.nan, 0.0)
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, number, 0, *params))
    assert not of_type(answers, "COMMAND_ACK")
    (forwarded,) = of_type(bench.vehicle.simulator_messages(), "COMMAND_LONG")
    assert forwarded.target_component == SIMULATOR_COMPONENT
    assert (forwarded.command, forwarded.param2) == (number, pytest.approx(0.9))
    ack = dialect.MAVLink_command_ack_message(number, DENIED, 0, 0, UAV, 1)
    answer = parse(FramePacker(UAV, SIMULATOR_COMPONENT).pack(ack))
    assert answer is not None
    bench.vehicle.receive_from_simulator(answer, bench.now)
    (result,) = of_type(bench.vehicle.gcs_messages(), "COMMAND_ACK")
    assert (result.result, result.target_system) == (DENIED, 255)


def test_unknown_commands_are_unsupported_never_silence(scenario1: Scenario) -> None:
    assert Bench(scenario1).command(31000) == dialect.MAV_RESULT_UNSUPPORTED


@pytest.mark.parametrize(
    "message_id", [dialect.MAVLINK_MSG_ID_ATTITUDE, dialect.MAVLINK_MSG_ID_FTC_EVENTS]
)
def test_messages_come_on_request(message_id: int, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    request = dialect.MAVLink_command_long_message(
        UAV, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, message_id, 0, 0, 0, 0, 0, 0
    )
    answers = bench.say(request)
    assert [m for m in answers if m.get_msgId() == message_id]


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 1e9])
def test_strange_parameters_are_refused_without_harm(value: float, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    for number in (dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, ARM):
        assert bench.command(number, value, value) != ACCEPTED


def test_telemetry_keeps_its_interval_in_simulated_time(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.run()
    counts = 0
    for step in range(0, 1001, 20):
        bench.hot.measured["time_usec"] = step * 1000
        bench.vehicle.handle_timer(0.0)
        counts += len(of_type(bench.vehicle.gcs_messages(), "ATTITUDE"))
    assert counts == 11


@pytest.mark.parametrize("over", [False, True])
def test_a_dropped_neighbour_is_announced(scenario1: Scenario, over: bool) -> None:
    bench = Bench(scenario1)
    bench.hot.edges[:] = 1
    bench.vehicle.handle_timer(0.0)
    bench.hot.edges[1] = 0
    bench.hot.edge_changes = 1
    if over:  # the flight ends before the next turn of the services
        bench.vehicle.farewell("simulation over")
    else:
        bench.vehicle.handle_timer(0.0)
    texts = [m.text for m in of_type(bench.vehicle.gcs_messages(), "STATUSTEXT")]
    assert any("neighbour 3 silent, edge dropped" in str(text) for text in texts)


SET_CURRENT = dialect.MAV_CMD_DO_SET_MISSION_CURRENT


def test_item_0_is_home_whatever_was_uploaded(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.say(dialect.MAVLink_mission_request_list_message(UAV, 1, 0))
    (home,) = of_type(
        bench.say(dialect.MAVLink_mission_request_int_message(UAV, 1, 0, 0)), "MISSION_ITEM_INT"
    )
    assert (home.command, home.x, home.y) == (16, -353632620, 1491652370)
    assert home.z == pytest.approx(584.0)


def test_a_mission_begins_with_the_current_item_and_then_from_its_start(
    scenario1: Scenario,
) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    assert bench.command(SET_CURRENT, 3.0) == ACCEPTED
    assert bench.command(START) == ACCEPTED
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == -15_000
    assert bench.command(START) == ACCEPTED
    assert bench.controllers.uavs[0]["guidance"]["start_step"] == 0


@pytest.mark.parametrize("params", [(2.0, 0.0), (0.0, 3.0)])
def test_parts_of_a_mission_cannot_be_started(
    params: tuple[float, float], scenario1: Scenario
) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    assert bench.command(START, *params) == DENIED


@pytest.mark.parametrize("seq", [4.0, -2.0, 1.5, math.nan])
def test_items_that_do_not_exist_cannot_be_current(seq: float, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    assert bench.command(SET_CURRENT, seq) == dialect.MAV_RESULT_FAILED
    assert bench.command(SET_CURRENT, -1.0) == ACCEPTED


def test_a_jump_is_reported_as_the_item_it_leads_to(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(START)
    bench.run()
    bench.hot.step = 1000
    bench.say(dialect.MAVLink_mission_set_current_message(UAV, 1, 2))
    bench.vehicle.handle_timer(bench.now)
    reported = of_type(bench.vehicle.gcs_messages(), "MISSION_CURRENT")
    assert {m.seq for m in reported} <= {2}


def test_mission_current_tells_the_state_of_the_mission(scenario1: Scenario) -> None:
    bench = Bench(scenario1)

    def reported() -> tuple[int, int, int]:
        number = dialect.MAVLINK_MSG_ID_MISSION_CURRENT
        message = dialect.MAVLink_command_long_message(
            UAV, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, number, 0, 0, 0, 0, 0, 0
        )
        bench.vehicle.handle_timer(bench.now)
        m = of_type(bench.say(message), "MISSION_CURRENT")[-1]
        return m.mission_state, m.mission_mode, m.total

    assert reported() == (dialect.MISSION_STATE_NO_MISSION, 2, 65535)
    bench.upload(scenario1)
    assert reported() == (dialect.MISSION_STATE_NOT_STARTED, 2, 3)
    bench.command(START)
    bench.run()
    assert reported() == (dialect.MISSION_STATE_ACTIVE, 1, 3)
    bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, LOITER)
    assert reported() == (dialect.MISSION_STATE_PAUSED, 2, 3)
    bench.hot.step = 20_000
    assert reported()[0] == dialect.MISSION_STATE_COMPLETE


def test_a_parameter_acts_between_two_steps_and_is_announced(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    said = bench.say(dialect.MAVLink_param_set_message(UAV, 1, b"LAMBDA3", 4.5, 9))
    assert bench.controllers.uavs[0]["parameters"]["common"]["lambda3"] == 4.5
    (value,) = of_type(said, "PARAM_VALUE")
    assert (value.param_id, value.param_value) == ("LAMBDA3", 4.5)
    assert [m.text for m in of_type(said, "STATUSTEXT")] == ["LAMBDA3 is 4.5 now"]
    said = bench.say(dialect.MAVLink_param_set_message(UAV, 1, b"LAMBDA3", -1.0, 9))
    assert [m.text for m in of_type(said, "STATUSTEXT")] == ["LAMBDA3 is -1, must be in (0, 50]"]


def test_what_is_for_others_is_left_alone(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    for target in ((2, 1), (UAV, 100), (0, 25)):
        for message in (
            dialect.MAVLink_command_long_message(*target, ARM, 0, 1, 0, 0, 0, 0, 0, 0),
            dialect.MAVLink_param_set_message(*target, b"LAMBDA3", 4.5, 9),
            dialect.MAVLink_mission_request_list_message(*target, 0),
            dialect.MAVLink_request_data_stream_message(*target, 0, 50, 1),
        ):
            assert bench.say(message) == []
    assert not bench.vehicle.modes.armed
    everyone = dialect.MAVLink_command_long_message(0, 0, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    assert of_type(bench.say(everyone), "COMMAND_ACK")[0].result == ACCEPTED


def test_commands_come_as_command_int_too(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    message = dialect.MAVLink_command_int_message(UAV, 1, 0, ARM, 0, 0, 1.0, 0, 0, 0, 0, 0, 0)
    assert of_type(bench.say(message), "COMMAND_ACK")[0].result == ACCEPTED
    assert bench.vehicle.modes.armed


def test_the_old_set_mode_message_is_understood(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.say(dialect.MAVLink_set_mode_message(UAV, 1, GUIDED))
    assert bench.vehicle.modes.mode == GUIDED
    bench.say(dialect.MAVLink_set_mode_message(UAV, 1, 6))
    assert bench.vehicle.modes.mode == GUIDED


@pytest.mark.parametrize(
    ("command", "params", "expected"),
    [
        (dialect.MAV_CMD_GET_HOME_POSITION, (), "HOME_POSITION"),
        (dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, (1.0,), "AUTOPILOT_VERSION"),
        (dialect.MAV_CMD_GET_MESSAGE_INTERVAL, (30.0,), "MESSAGE_INTERVAL"),
        (dialect.MAV_CMD_REQUEST_MESSAGE, (244.0, 30.0), "MESSAGE_INTERVAL"),
        (dialect.MAV_CMD_REQUEST_MESSAGE, (0.0,), "HEARTBEAT"),
        (dialect.MAV_CMD_REQUEST_MESSAGE, (193.0,), "EKF_STATUS_REPORT"),
    ],
)
def test_messages_come_by_other_commands(
    command: int, params: tuple[float, ...], expected: str, scenario1: Scenario
) -> None:
    seven = (*params, *[0.0] * 7)[:7]
    message = dialect.MAVLink_command_long_message(UAV, 1, command, 0, *seven)
    answers = Bench(scenario1).say(message)
    assert len(of_type(answers, expected)) == 1
    assert of_type(answers, "COMMAND_ACK")[0].result == ACCEPTED


def test_a_generic_autopilot_says_so(scenario1: Scenario) -> None:
    bench = Bench(scenario1.model_copy(update={"identity": "generic"}))
    bench.vehicle.handle_timer(0.0)
    (heartbeat,) = of_type(bench.vehicle.gcs_messages(), "HEARTBEAT")
    assert heartbeat.autopilot == dialect.MAV_AUTOPILOT_GENERIC
    read = dialect.MAVLink_param_request_read_message(UAV, 1, b"SYSID_THISMAV", -1)
    (value,) = of_type(bench.say(read), "PARAM_VALUE")
    assert value.param_value == pytest.approx(1.4e-45)  # the integer 1, byte by byte


def test_timers_at_the_deadline_are_enough(scenario1: Scenario) -> None:
    """Heartbeats keep their rate, and an upload that breaks off is asked for and given up."""
    bench = Bench(scenario1)
    bench.vehicle.handle_timer(bench.now)
    bench.say(dialect.MAVLink_mission_count_message(UAV, 1, 3, 0))
    said: list[Any] = []
    beats = []
    while bench.now < 40.0:  # the client stays silent
        at = bench.vehicle.deadline()
        assert at > bench.now
        bench.now = at
        bench.vehicle.handle_timer(at)
        messages = bench.vehicle.gcs_messages()
        beats += [at for _ in of_type(messages, "HEARTBEAT")]
        said += messages
    assert np.diff(beats) == pytest.approx(1.0)
    assert len(of_type(said, "MISSION_REQUEST_INT")) >= 4
    (ack,) = of_type(said, "MISSION_ACK")
    assert ack.type == dialect.MAV_MISSION_OPERATION_CANCELLED

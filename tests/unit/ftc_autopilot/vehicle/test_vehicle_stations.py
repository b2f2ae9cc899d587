"""A vehicle's messages to each of its ground stations."""

import pytest
from vehicle_bench import ACCEPTED, UAV, Bench, of_type

from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import SIMULATOR_COMPONENT
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.profile import segments_to_items

EVENTS = dialect.MAVLINK_MSG_ID_FTC_EVENTS
REQUEST, SET_INTERVAL = dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL


def test_private_messages_go_to_the_station_that_asks_for_them(scenario1: Scenario) -> None:
    bench = Bench(scenario1, stations=2)

    def reported(station: int) -> set[str]:
        for _ in range(2):  # streams begin one after the other, within 20 ms
            bench.now += 0.5
            bench.vehicle.handle_timer(bench.now)
        return {message.get_type() for message in bench.vehicle.gcs_messages(station)}

    assert not any(name.startswith("FTC_") for name in reported(0) | reported(1))
    assert bench.command(SET_INTERVAL, EVENTS, 2e5, station=1) == ACCEPTED
    for _ in range(3):
        assert "FTC_EVENTS" in reported(1)
    assert reported(0) >= {"HEARTBEAT", "ATTITUDE"}
    request = (UAV, 1, REQUEST, 0, EVENTS, 0, 0, 0, 0, 0, 0)
    assert of_type(bench.say(dialect.MAVLink_command_long_message(*request), 1), "FTC_EVENTS")
    bench.vehicle.farewell("over")
    said = bench.vehicle.gcs_messages(0)
    assert of_type(said, "STATUSTEXT")
    assert not of_type(said, "FTC_EVENTS")
    assert of_type(bench.vehicle.gcs_messages(1), "FTC_EVENTS")


def test_faults_are_listed_to_the_station_that_asks(scenario1: Scenario) -> None:
    bench = Bench(scenario1, stations=2)
    fault = dialect.MAVLINK_MSG_ID_FTC_FAULT
    request = (UAV, 1, REQUEST, 0, fault, 0, 0, 0, 0, 0, 0)
    bench.say(dialect.MAVLink_command_long_message(*request), 1)
    simulator = FramePacker(UAV, SIMULATOR_COMPONENT)
    for message in (
        dialect.MAVLink_ftc_fault_message(0, 0, 0, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_command_ack_message(REQUEST, ACCEPTED, 0, 0, UAV, 1),
    ):
        received = parse(simulator.pack(message))
        assert received is not None
        bench.vehicle.receive_from_simulator(received, bench.now)
    assert not of_type(bench.vehicle.gcs_messages(0), "FTC_FAULT")
    assert of_type(bench.vehicle.gcs_messages(1), "FTC_FAULT")


def test_an_interval_that_is_too_short_is_said_to_be(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    request = (UAV, 1, SET_INTERVAL, 0, dialect.MAVLINK_MSG_ID_ATTITUDE, 1000, 0, 0, 0, 0, 0)
    answers = bench.say(dialect.MAVLink_command_long_message(*request))
    assert of_type(answers, "COMMAND_ACK")[0].result == ACCEPTED
    assert [m.interval_us for m in of_type(answers, "MESSAGE_INTERVAL")] == [20_000]
    text = "".join(m.text for m in of_type(answers, "STATUSTEXT"))
    assert text == "Message 30: interval is 1000 us, must be >= 20000 us, which it is now"


def test_one_of_two_stations_with_one_id_uploads(scenario1: Scenario) -> None:
    """Each hears only what it is answered; the one that came second is answered to wait."""
    bench = Bench(scenario1, stations=2)
    items = segments_to_items(scenario1.segments(), UAV, 1)
    count = dialect.MAVLink_mission_count_message(UAV, 1, len(items), 0)
    assert of_type(bench.say(count, 0), "MISSION_REQUEST_INT")
    (refusal,) = of_type(bench.say(count, 1), "MISSION_ACK")
    assert refusal.type == dialect.MAV_MISSION_DENIED
    for item in items:
        answers = bench.say(item, 0)
        assert not [m for m in bench.vehicle.gcs_messages(1) if hasattr(m, "target_system")]
    assert of_type(answers, "MISSION_ACK")[0].type == dialect.MAV_MISSION_ACCEPTED


def test_time_since_boot_in_every_answer(scenario1: Scenario) -> None:
    bench = Bench(scenario1)

    def boot_ns() -> int:
        (answer,) = of_type(bench.say(dialect.MAVLink_timesync_message(0, 77)), "TIMESYNC")
        assert answer.ts1 == 77
        return int(answer.tc1)

    first = boot_ns()
    bench.now += 1.24  # and 10 ms for what is said
    assert boot_ns() - first == pytest.approx(1_250_000_000, abs=1000)

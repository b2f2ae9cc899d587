"""What a member of a formation tells of it, and what orders for its slot it takes."""

import math
from typing import Any

import pytest
from vehicle_bench import ACCEPTED, ARM, DENIED, Bench, of_type

from ftc_autopilot.control.controllers import ReferenceSource, begin_path
from ftc_autopilot.guidance.members import LEAVE, LOST, SILENT, STAY, enter
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import RTL

SET_SLOT = dialect.MAV_CMD_FTC_SET_SLOT
REQUEST, FORMATION = dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_FTC_FORMATION


@pytest.fixture
def bench() -> Bench:
    bench = Bench(load_scenario("missions/hexagon"))
    bench.run()
    begin_path(bench.controllers.uavs[0]["guidance"])
    state = bench.controllers.uavs[0]["formation"]
    state["path_id"], state["xi"], state["distance"], state["nearest"] = 7, 120.0, 28.3, 2
    state["slot_of"] = range(64)
    said(bench)
    return bench


def said(bench: Bench) -> list[str]:
    """Texts of what the vehicle says at its next timer."""
    bench.now += 0.01
    bench.vehicle.handle_timer(bench.now)
    texts: list[str] = []
    for chunk in of_type(bench.vehicle.gcs_messages(), "STATUSTEXT"):
        if chunk.chunk_seq == 0:
            texts.append("")
        texts[-1] += chunk.text
    return texts


def reported(bench: Bench) -> Any:
    request = dialect.MAVLink_command_long_message(1, 1, REQUEST, 0, FORMATION, 0, 0, 0, 0, 0, 0)
    (message,) = of_type(bench.say(request), "FTC_FORMATION")
    return message


def test_a_slot_is_ordered_and_taken_back(bench: Bench) -> None:
    commanded = bench.controllers.uavs[0]["formation"]["commanded"]
    assert bench.command(SET_SLOT, -60.0, 5.0, 10.0) == ACCEPTED
    assert commanded.tolist() == [-60.0, 5.0, 10.0]
    assert bench.command(SET_SLOT, math.nan, math.nan, math.nan) == ACCEPTED
    assert all(map(math.isnan, commanded))


@pytest.mark.parametrize(
    ("slot", "reason"),
    [
        ((1e4, 0.0, 0.0), "Slot: ahead is 10000 m, must be -1000 to 1000 m"),
        ((0.0, -math.inf, 0.0), "Slot: right is -inf m, must be -1000 to 1000 m"),
        ((0.0, 0.0, math.nan), "Slot: is partly NaN, must be three distances or three NaN"),
    ],
)
def test_a_slot_that_cannot_be_is_refused(
    bench: Bench, slot: tuple[float, float, float], reason: str
) -> None:
    message = dialect.MAVLink_command_long_message(1, 1, SET_SLOT, 0, *slot, 0, 0, 0, 0)
    answers = bench.say(message)
    (ack,) = of_type(answers, "COMMAND_ACK")
    assert ack.result == DENIED
    assert "".join(text.text for text in of_type(answers, "STATUSTEXT")) == reason
    assert all(map(math.isnan, bench.controllers.uavs[0]["formation"]["commanded"]))


def test_who_is_in_no_formation_takes_no_slot(scenario1: Scenario) -> None:
    alone = Bench(scenario1)
    assert alone.command(SET_SLOT, 0.0, 0.0, 0.0) == DENIED
    assert reported(alone).path_id == 0


def test_a_member_tells_how_it_sees_the_formation(bench: Bench) -> None:
    state = bench.controllers.uavs[0]["formation"]
    state["error"] = (0.5, -0.25, math.nan)
    enter(state["table"], 0, 4 * LOST + LEAVE)
    message = reported(bench)
    assert (message.path_id, message.path_position, message.nearest) == (7, 120.0, 2)
    assert message.slot_error[:2] == [0.5, -0.25]
    assert math.isnan(message.slot_error[2])
    assert message.distance == pytest.approx(28.3)
    cause, policy = dialect.FTC_CAUSE_LOST, dialect.FTC_POLICY_LEAVE
    assert (message.cause, message.policy, message.report[0]) == (cause, policy, 16 + 11)


def test_changes_are_announced_once(bench: Bench) -> None:
    state = bench.controllers.uavs[0]["formation"]
    enter(state["table"], 0, 4 * LOST + STAY)
    enter(state["table"], 1, 4 * LOST + LEAVE)  # which UAV 2 announces itself
    enter(state["table"], 2, 4 * SILENT + LEAVE)
    state["slot_of"][0] = 2
    assert said(bench) == [
        "formation: UAV 1: an actuator is lost, it stays",
        "formation: UAV 3: silent, it leaves",
        "formation: UAV 1 takes the slot of UAV 3",
    ]
    assert said(bench) == []
    bench.hot.measured["time_usec"] += 1_000_000
    enter(state["table"], 2, 0)
    state["slot_of"][0] = 0
    assert said(bench) == [
        "formation: UAV 3 is well again",
        "formation: UAV 1 takes its own slot",
    ]


def test_evading_and_too_small_a_distance_are_announced(bench: Bench) -> None:
    state = bench.controllers.uavs[0]["formation"]
    state["evading"], state["distance"] = 1, 17.26
    assert said(bench) == ["evading, the nearest is UAV 2, 17.3 m away"]
    state["distance"] = 14.9
    assert said(bench) == ["UAV 2 is 14.9 m away, less than 15 m"]
    assert said(bench) == []


def test_policies_are_parameters(bench: Bench) -> None:
    message = dialect.MAVLink_param_request_read_message(1, 1, b"FORM_ON_LOST", -1)
    (value,) = of_type(bench.say(message), "PARAM_VALUE")
    assert value.param_value == STAY
    real = dialect.MAV_PARAM_TYPE_INT32
    bench.say(dialect.MAVLink_param_set_message(1, 1, b"FORM_ON_LOST", float(LEAVE), real))
    assert bench.controllers.uavs[0]["parameters"]["formation"]["on_lost"] == LEAVE


def test_slots_are_of_the_mission_only(bench: Bench) -> None:
    """A member that is ordered elsewhere flies there itself, not beside it."""
    guidance = bench.controllers.uavs[0]["guidance"]
    assert guidance["in_slot"] == 1
    assert bench.command(ARM, 1.0) == ACCEPTED
    assert bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, RTL) == ACCEPTED
    assert guidance["follows"] == ReferenceSource.PATH
    assert guidance["in_slot"] == 0

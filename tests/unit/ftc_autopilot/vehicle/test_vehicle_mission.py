"""The mission while it is flown."""

from typing import Any

from vehicle_bench import START, UAV, Bench, of_type

from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, LOITER
from mavlink_defs.profile import segments_to_items


def test_items_that_were_not_flown_are_not_reached(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(START)
    bench.run()

    def fly_to(step: int) -> list[Any]:
        bench.hot.step = step
        bench.vehicle.tick(bench.now)
        return bench.vehicle.gcs_messages()

    fly_to(1000)
    assert [m.seq for m in of_type(fly_to(4001), "MISSION_ITEM_REACHED")] == [1]
    bench.upload(scenario1)
    said = fly_to(4002)
    assert not of_type(said, "MISSION_ITEM_REACHED")
    assert {m.seq for m in of_type(said, "MISSION_CURRENT")} == {2}
    bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, LOITER)
    fly_to(15_001)
    bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, AUTO)
    assert not of_type(fly_to(15_002), "MISSION_ITEM_REACHED")


def test_a_profile_uploaded_in_flight_says_what_is_flown(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.command(START)
    bench.run()
    count = len(segments_to_items(scenario1.segments(), UAV, 1))
    texts = {
        4001: "profile of 3 segments in force, segment 2 at 4.001 s of the mission",
        20_000: "profile of 3 segments in force, segment 3 at 20.000 s of the mission; "
        "to fly it from its start, start the mission again",
    }
    for step, text in texts.items():
        bench.hot.step = step
        items = segments_to_items(scenario1.segments(), UAV, 1)
        bench.say(dialect.MAVLink_mission_count_message(UAV, 1, count, 0))
        said = [m for item in items for m in bench.say(item)]
        assert "".join(m.text for m in of_type(said, "STATUSTEXT")) == text

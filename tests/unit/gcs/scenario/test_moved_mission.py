"""Missions of elsewhere: all places stay where they are, seen from home."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.common.geography import Origin, place_of, position_of
from ftc_autopilot.guidance.mission_places import home_item
from gcs.scenario.moved_mission import moved_to
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.mission_files import mission_item

HERE = Origin()
THERE = Origin(latitude_deg=47.4, longitude_deg=8.5, altitude_m=488.0)
metres = st.floats(-5000.0, 5000.0)


@given(st.lists(st.tuples(metres, metres), min_size=1, max_size=4), st.sampled_from([0, 3, 10]))
def test_every_place_is_where_it_was_seen_from_home(
    places: list[tuple[float, float]], frame: int
) -> None:
    items = [home_item(THERE)]
    for seq, place in enumerate(places, start=1):
        altitude = 588.0 if frame == 0 else 100.0
        x, y, *_ = place_of(THERE, *place, 0.0)
        items.append(mission_item(seq, 16, (1.0, 2.0, 3.0, math.nan), x, y, altitude, frame))
    moved = moved_to(home_item(HERE), items)
    for place, item in zip(places, moved[1:], strict=True):
        assert position_of(HERE, item.x, item.y) == pytest.approx(place, abs=0.05)
        assert item.z == (684.0 if frame == 0 else 100.0)
        assert (item.param1, item.param2, item.param3, item.frame) == (1.0, 2.0, 3.0, frame)


def test_what_has_no_place_stays_as_it_is() -> None:
    x, y, *_ = place_of(THERE, 100.0, 0.0, 0.0)
    items = [
        home_item(THERE),
        mission_item(1, 16, (), x, y, 100.0),
        mission_item(2, 18, (1.0,), 0, 0, 0.0),
        mission_item(3, 17, (), INT32_MAX, INT32_MAX, 80.0),
        mission_item(4, 183, (9.0, 1500.0), 12, 34, 5.0, 2),
        mission_item(5, 177, (1.0, 2.0), 0, 0, 0.0, 2),
    ]
    moved = moved_to(home_item(HERE), items)
    assert moved[2:] == tuple(items[2:])
    assert moved_to(home_item(HERE), [items[0], *items[4:]])[1:] == tuple(items[4:])


@pytest.mark.parametrize(
    "home", [mission_item(0, 16), home_item(HERE)], ids=["none", "of the flight before"]
)
def test_without_a_home_near_it_a_mission_is_moved_from_its_first_place(home: object) -> None:
    x, y, *_ = place_of(THERE, 0.0, 0.0, 0.0)
    takeoff = mission_item(1, 22, (), *place_of(THERE, -900.0, 0.0, 0.0)[:2], 50.0)
    moved = moved_to(home_item(HERE), [home, takeoff, mission_item(2, 16, (), x, y, 100.0)])  # type: ignore[list-item]  # parameters have no types
    assert position_of(HERE, moved[1].x, moved[1].y) == pytest.approx((0.0, 0.0), abs=0.02)
    assert position_of(HERE, moved[2].x, moved[2].y) == pytest.approx((900.0, 0.0), abs=0.05)

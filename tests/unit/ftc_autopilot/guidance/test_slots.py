"""Slots: by plan, by command, and what becomes of them in trouble."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.guidance.formation import (
    MAX_MEMBERS,
    Formation,
    FormationParameters,
    layout_record,
)
from ftc_autopilot.guidance.members import LEAVE, LOST, WIDEN, enter
from ftc_autopilot.guidance.slots import SLOT_MOTION, move, place_of_slot
from mavlink_defs.config.models import Problems

V = {1: {}, 2: {"ahead_m": -20, "right_m": -20}, 3: {"ahead_m": -20, "right_m": 20}}
COLUMN = {2: {"ahead_m": -25}, 3: {"ahead_m": -50}}


def formation(**keys: object) -> Formation:
    return Formation.model_validate({"slots": V, **keys})


def gains_of(given_formation: Formation) -> np.void:
    record: np.void = np.zeros(1, record_dtype(FormationParameters))[0]
    fill(record, given_formation)
    return record


def slot(
    given_formation: Formation,
    own: int,
    state: int = 0,
    commanded: tuple[float, float, float] = (math.nan, math.nan, math.nan),
    plan: int = 0,
) -> tuple[float, float, float]:
    layout = layout_record(given_formation, own, 0.0, {})
    table = np.zeros(MAX_MEMBERS, np.uint8)
    enter(table, int(layout["own"]), state)
    gains, own_slots = gains_of(given_formation), np.arange(MAX_MEMBERS)
    return place_of_slot(plan, layout, gains, table, own_slots, np.array(commanded))


def test_a_slot_is_the_planned_one_or_the_commanded_one() -> None:
    given_formation = formation(changes=[{"at_s": 9.0, "slots": COLUMN}])
    assert slot(given_formation, 2) == (-20.0, -20.0, 0.0)
    assert slot(given_formation, 2, plan=1) == (-25.0, 0.0, 0.0)
    assert slot(given_formation, 1, plan=1) == (0.0, 0.0, 0.0)
    assert slot(given_formation, 3, commanded=(-60.0, 5.0, 10.0)) == (-60.0, 5.0, 10.0)


def test_who_leaves_is_where_the_formation_says() -> None:
    given_formation = formation(leave_ahead_m=-80.0, leave_right_m=5.0, leave_up_m=40.0)
    assert slot(given_formation, 2, 4 * LOST + LEAVE) == (-100.0, -15.0, 40.0)


def test_a_wider_slot_is_further_from_the_middle() -> None:
    given_formation = formation(widen_m=30.0)
    middle = np.array([-40.0 / 3.0, 0.0, 0.0])
    for uav, planned in ((1, (0.0, 0.0, 0.0)), (3, (-20.0, 20.0, 0.0))):
        wide = np.array(slot(given_formation, uav, 4 * LOST + WIDEN))
        before, after = np.array(planned) - middle, wide - middle
        assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before) + 30.0)
        assert np.cross(before, after) == pytest.approx(np.zeros(3), abs=1e-9)
    alone = Formation.model_validate({"slots": {1: {}}, "widen_m": 30.0})
    assert slot(alone, 1, 4 * LOST + WIDEN) == (0.0, 0.0, 30.0)


@settings(max_examples=settings().max_examples // 4)  # thousands of steps each
@given(
    st.tuples(*[st.floats(-200.0, 200.0)] * 3),
    st.tuples(*[st.floats(-200.0, 200.0)] * 3),
    st.floats(0.5, 10.0),
)
def test_a_slot_is_moved_to_smoothly_at_a_limited_speed(
    begin: tuple[float, float, float], target: tuple[float, float, float], speed: float
) -> None:
    motion: np.void = np.zeros(1, SLOT_MOTION)[0]
    dt = 0.02
    move(begin, speed, dt, True, motion)
    assert motion["place"].tolist() == list(begin)
    before = motion["rate"].copy()
    for _ in range(round((math.dist(begin, target) / speed + 15.0) / dt)):
        move(target, speed, dt, False, motion)
        rate = motion["rate"]
        assert np.linalg.norm(rate) <= speed * (1.0 + 1e-6)
        assert np.linalg.norm(rate - before) <= 1.01 * speed * dt
        before = rate.copy()
    assert motion["place"] == pytest.approx(target, abs=1e-2)


@pytest.mark.parametrize(
    ("keys", "place", "text"),
    [
        (
            {"changes": [{"at_s": 9.0, "slots": COLUMN}, {"at_s": 8.0, "slots": COLUMN}]},
            ("changes", 1, "at_s"),
            "expected later than 9 s",
        ),
        (
            {"changes": [{"at_s": 9.0, "slots": {4: {}}}]},
            ("changes", 0, "slots", 4),
            "expected a member of the formation (1, 2, 3), got UAV 4",
        ),
        (
            {"changes": [{"at_s": 9.0, "slots": {2: {"ahead_m": -10}}}]},
            ("changes", 0, "slots"),
            "UAVs 1 and 2 are 10 m apart there, expected at least separation_m, 15 m",
        ),
        ({"separation_m": 30.0}, ("slots",), "UAVs 1 and 2 are 28.3 m apart"),
    ],
)
def test_slots_that_cannot_be_are_refused(
    keys: dict[str, object], place: tuple[object, ...], text: str
) -> None:
    with pytest.raises(ValidationError, match="expected") as caught:
        formation(**keys)
    problems = [error["ctx"]["error"] for error in caught.value.errors() if "ctx" in error]
    found = [
        problem for each in problems if isinstance(each, Problems) for problem in each.problems
    ]
    assert found[0].loc == place
    assert text in found[0].text

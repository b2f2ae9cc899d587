"""Figures of path following and separation, from flights whose errors are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.path import path_record, point_at
from gcs.results.path_following import SETTLING_S, PathErrors, PathFigures
from gcs.results.recording import Steps
from gcs.results.separation import Separation

STEP_US, SPEED = 100_000, 40.0
SETTLING = round(SETTLING_S * 1e6 / STEP_US)
STRAIGHT_M, RADIUS_M = 1600.0, 400.0
TURN_M = RADIUS_M * math.pi / 2.0
SIGNALS = np.dtype([("V", "f8"), ("path_position", "f8"), ("slot", "f8", (3,))])


def corner() -> np.void:
    """North, a quarter of a circle to the right, then east for ever; it climbs before the turn."""
    legs = (
        Leg(0.0, 0.0, 0.0, 0.0, STRAIGHT_M, 500.0, 0.05, 40.0, 1),
        Leg(STRAIGHT_M, 0.0, 0.0, 1.0 / RADIUS_M, TURN_M, 580.0, 0.0, 40.0, 1),
        Leg(STRAIGHT_M + RADIUS_M, RADIUS_M, math.pi / 2.0, 0.0, math.inf, 580.0, 0.0, 40.0, 2),
    )
    return path_record(legs)


def flight(
    steps: int,
    slots: list[tuple[float, float, float]],
    late_m: list[float],
    right_m: list[float],
    above_m: list[float],
) -> Steps:
    """UAVs that fly their slots with constant errors: late, to the right, above."""
    path, n = corner(), len(slots)
    made = Steps(
        0,
        np.zeros((steps, n, 12)),
        np.zeros((steps, n, 3)),
        np.zeros((steps, n, 4)),
        np.zeros((steps, n), SIGNALS),
        np.zeros((steps, n, 0)),
    )
    made.signals["V"] = SPEED
    made.signals["slot"] = np.array(slots)
    for k in range(steps):
        for i, (ahead, right, up) in enumerate(slots):
            s = k * SPEED * STEP_US / 1e6 + ahead - late_m[i]
            point = point_at(path, s)
            side = right + right_m[i]
            made.states[k, i, 0] = point.north - math.sin(point.course) * side
            made.states[k, i, 1] = point.east + math.cos(point.course) * side
            made.states[k, i, 2] = -(point.height + up + above_m[i])
            made.signals["path_position"][k, i] = s
    return made


def followed(steps: Steps, leaders: tuple[int, ...] = (0,)) -> PathFigures:
    following = PathFigures(np.stack([corner()] * steps.states.shape[1]), leaders, STEP_US)
    following.add(steps)
    return following


V_FORMATION = [(0.0, 0.0, 0.0), (-20.0, 20.0, 5.0), (-20.0, -20.0, 5.0)]
errors = st.tuples(*[st.floats(-15.0, 15.0)] * 3)


@given(errors, errors, errors)
def test_constant_errors_are_found(
    late: tuple[float, ...], right: tuple[float, ...], above: tuple[float, ...]
) -> None:
    steps = flight(700, V_FORMATION, list(late), list(right), list(above))
    following = followed(steps)
    for i in range(3):
        found = following.summary(i)
        assert (found.flown_steps, found.counted_steps) == (700, 699 - SETTLING)
        assert found.slot_steps == found.counted_steps
        assert found.straight_cross_track_m == pytest.approx(abs(right[i]), abs=1e-6)
        assert found.turn_cross_track_m == pytest.approx(abs(right[i]), abs=1e-6)
        assert found.height_max_m == pytest.approx(abs(above[i]), abs=1e-6)
        assert found.height_rms_m == pytest.approx(abs(above[i]), abs=1e-6)
        behind = late[i] - late[0]  # the slot is where the leader is, not where it should be
        assert found.slot_rms_m is not None
        assert found.slot_max_m is not None
        straight = math.hypot(behind, right[i])
        shorter = math.hypot(behind * (1.0 - 40.0 / RADIUS_M), right[i])
        assert shorter - 0.3 <= found.slot_rms_m <= found.slot_max_m
        assert found.slot_max_m <= straight * (1.0 + 40.0 / RADIUS_M) + 0.3


def test_an_autopilot_that_does_not_say_where_it_is_is_judged_from_the_start_on() -> None:
    steps = flight(700, [(0.0, 0.0, 0.0)] * 2, [0.0, 30.0], [3.0, -4.0], [2.0, -1.0])
    steps.signals["path_position"] = steps.signals["slot"] = math.nan
    following = PathFigures(np.stack([corner()] * 2), (), STEP_US, silent=[1])
    following.add(steps)
    assert following.summary(0).counted_steps == 0
    found = following.summary(1)
    assert found.counted_steps == 699 - SETTLING
    assert found.straight_cross_track_m == pytest.approx(4.0, abs=1e-6)
    assert found.turn_cross_track_m == pytest.approx(4.0, abs=1e-6)
    assert found.height_max_m == pytest.approx(1.0, abs=1e-6)


def test_an_error_belongs_to_the_part_of_the_path_that_it_is_on() -> None:
    turn = round(STRAIGHT_M / SPEED * 1e6 / STEP_US)
    end = turn + round(TURN_M / SPEED * 1e6 / STEP_US)
    places = {
        "the first seconds": (SETTLING, None, None),
        "the first straight": (SETTLING + 1, 9.0, 1.0),
        "the last step before the turn": (turn - 1, 9.0, 1.0),
        "the turn": (turn + 1, 1.0, 9.0),
        "soon after the turn": (end + SETTLING, 1.0, 9.0),
        "the straight after it": (end + SETTLING + 2, 9.0, 1.0),
    }
    for place, (k, straight, curved) in places.items():
        steps = flight(end + SETTLING + 50, [(0.0, 0.0, 0.0)], [0.0], [1.0], [0.0])
        course = point_at(corner(), k * SPEED * STEP_US / 1e6).course
        steps.states[k, 0, :2] += 8.0 * np.array([-math.sin(course), math.cos(course)])
        found = followed(steps).summary(0)
        expected = (straight or 1.0, curved or 1.0)
        assert (found.straight_cross_track_m, found.turn_cross_track_m) == pytest.approx(
            expected, abs=1e-6
        ), place


@given(st.lists(st.integers(0, 500), max_size=5))
def test_it_does_not_matter_how_the_steps_arrive(cuts: list[int]) -> None:
    steps = flight(500, V_FORMATION, [0.0, 3.0, -2.0], [0.5, -1.0, 2.0], [0.0, 1.0, -3.0])
    steps.signals["V"][200:230, 1] = np.nan
    steps.signals["path_position"][200:230, 1] = np.nan
    whole, parts = followed(steps), PathFigures(np.stack([corner()] * 3), (0,), STEP_US)
    separation, together = Separation((1, 2, 3), STEP_US), Separation((1, 2, 3), STEP_US)
    separation.add(0, steps.states)
    for begin, end in zip([0, *sorted(cuts)], [*sorted(cuts), 500], strict=True):
        parts.add(steps.part(begin, end))
        together.add(begin, steps.states[begin:end])
    assert [parts.summary(i) for i in range(3)] == [whole.summary(i) for i in range(3)]
    assert together.summary() == separation.summary()


def test_what_is_not_known_is_not_counted() -> None:
    steps = flight(300, V_FORMATION, [0.0] * 3, [0.0] * 3, [0.0] * 3)
    steps.signals["V"][150:160, 0] = np.nan  # the leader's autopilot received nothing
    steps.signals["path_position"][150:160, 0] = np.nan
    steps.signals["path_position"][:, 2] = np.nan  # never followed the path
    following = followed(steps)
    leader, member, other = (following.summary(i) for i in range(3))
    assert (leader.flown_steps, leader.counted_steps) == (290, 289 - SETTLING)
    assert (member.counted_steps, member.slot_steps) == (299 - SETTLING, 289 - SETTLING)
    assert (other.flown_steps, other.counted_steps, other.slot_steps) == (0, 0, 0)
    assert other.straight_cross_track_m is other.height_rms_m is other.slot_max_m is None


def test_who_follows_another_path_is_not_judged_by_this_one() -> None:
    steps = flight(300, V_FORMATION, [0.0] * 3, [0.0] * 3, [0.0] * 3)
    steps.signals["path_position"][:, 1] += 500.0
    following = followed(steps)
    assert following.summary(1).flown_steps == 300
    assert following.summary(1).counted_steps == 0
    assert following.summary(2).slot_max_m == pytest.approx(0.0, abs=1e-6)


def test_a_path_that_begins_far_beside_this_one_is_another() -> None:
    """After a loss it glides along its own path, 400 m beside; by and by both are as far along."""
    steps = flight(390, [(0.0, 0.0, 0.0)], [0.0], [0.0], [0.0])
    steps.states[120:, 0, 1] += 400.0
    place = steps.signals["path_position"][120:, 0]
    place += np.linspace(-150.0, 66.0, len(place))
    found = followed(steps).summary(0)
    assert found.flown_steps == 390
    assert found.straight_cross_track_m == pytest.approx(0.0, abs=1e-6)


def test_the_next_leader_serves_if_the_first_has_left() -> None:
    steps = flight(300, V_FORMATION, [0.0, 6.0, 0.0], [0.0] * 3, [0.0] * 3)
    steps.signals["path_position"][:, 0] = np.nan
    following = followed(steps, (0, 1))
    assert following.summary(1).slot_max_m == pytest.approx(0.0, abs=1e-6)
    assert following.summary(2).slot_max_m == pytest.approx(6.0, abs=1e-6)
    assert followed(steps, ()).summary(1).slot_steps == 0


def test_a_lost_aircraft_spoils_no_figure() -> None:
    steps = flight(300, V_FORMATION, [0.0] * 3, [1.0] * 3, [0.0] * 3)
    steps.states[250:, 1] = np.nan
    following = followed(steps)
    assert following.summary(1).straight_cross_track_m == pytest.approx(1.0)
    assert following.summary(1).counted_steps == 249 - SETTLING
    separation = Separation((1, 2, 3), STEP_US)
    separation.add(0, steps.states)
    found = separation.summary()
    assert found is not None
    assert found.least_m == pytest.approx(math.hypot(20.0, 20.0, 5.0), abs=1.0)


def test_errors_step_by_step_are_those_that_are_summed_up() -> None:
    steps = flight(200, V_FORMATION, [0.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0] * 3)
    found = PathErrors(np.stack([corner()] * 3), (0,), STEP_US).of(steps)
    assert found["cross_track"][:, 1] == pytest.approx(np.full(200, 1.0), abs=1e-6)
    assert found["slot"][:, 1] == pytest.approx(np.full(200, math.hypot(2.0, 1.0)), abs=1e-6)


def test_the_least_separation_is_between_the_nearest_two() -> None:
    states = np.zeros((3, 4, 12))
    states[:, :, 0] = [0.0, 100.0, 250.0, 400.0]
    states[1, 2, :3] = (103.0, 4.0, -12.0)
    separation = Separation((5, 6, 7, 9), STEP_US)
    separation.add(0, states)
    found = separation.summary()
    assert found is not None
    assert (found.least_m, found.time_s, found.uavs) == (13.0, 0.1, (6, 7))
    alone = Separation((5,), STEP_US)
    alone.add(0, states[:, :1])
    assert alone.summary() is None

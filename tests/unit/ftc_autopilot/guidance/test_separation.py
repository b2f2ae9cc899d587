"""Neighbours keep their distance, however their ways cross."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ftc_autopilot.guidance.formation import LAYOUT
from ftc_autopilot.guidance.members import LOST, STAY
from ftc_autopilot.guidance.places import FORGOTTEN_S, PLACE
from ftc_autopilot.guidance.separation import keep_apart, nearest

DT = 0.02
MIN_M, RATE = 15.0, 0.3
CALM, MIN_AIRSPEED_M_S = (0.0, 0.0, 0.0), 30.0
LAG_S = 0.4  # three times in a row, as the reference filter
Vector = tuple[float, float, float]


def place(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    known = np.zeros(1, PLACE)
    known["position"], known["velocity"] = position, velocity
    return known


def seen(others: np.ndarray, own: int = 0) -> tuple[np.ndarray, np.void]:
    """Return places and layout of who is the first member, or the last one, beside others."""
    places, layout = np.zeros(len(others) + 1, PLACE), np.zeros(1, LAYOUT)[0]
    layout["count"], layout["own"] = len(places), own
    places[:own], places[own + 1 :] = others[:own], others[own:]
    return places, layout


def evaded(
    expected: Vector,
    position: Vector,
    velocity: Vector,
    others: np.ndarray,
    own: int = 0,
    *,
    step: int = 0,
    state: int = 0,
) -> np.ndarray:
    places, layout = seen(others, own)
    table = np.full(len(places), state, np.uint8)
    flown = expected, position, velocity, CALM, MIN_AIRSPEED_M_S
    return np.array(keep_apart(*flown, places, layout, table, step, DT, MIN_M, RATE))


class Uav:
    """Flies velocities asked for, late, and asks for those that bring it to a moving place."""

    def __init__(self, place: np.ndarray, velocity: np.ndarray, evades: bool = True) -> None:
        self.place, self.velocity = place, velocity
        self.position = place.copy()
        self.lags = [velocity.copy() for _ in range(3)]
        self.evades = evades

    def ask(self, others: list["Uav"], own: int, state: int = 0) -> np.ndarray:
        pull = 0.8 * (self.place - self.position)
        pull *= min(1.0, 8.0 / max(float(np.linalg.norm(pull)), 1e-9))
        expected = self.velocity + pull
        if not self.evades:
            return np.asarray(expected)
        reported = np.concatenate([place(other.position, other.lags[-1]) for other in others])
        flown = tuple(self.position), tuple(self.lags[-1])
        return evaded(tuple(expected), *flown, reported, own, state=state)

    def move(self, asked: np.ndarray) -> None:
        for k, goal in enumerate([asked, *self.lags[:-1]]):
            self.lags[k] = self.lags[k] + DT / LAG_S * (goal - self.lags[k])
        self.position = self.position + DT * self.lags[-1]
        self.place = self.place + DT * self.velocity


def least_distance(first: Uav, second: Uav, time_s: float) -> float:
    least = math.inf
    for _ in range(round(time_s / DT)):
        asked = first.ask([second], 0), second.ask([first], 1)
        first.move(asked[0])
        second.move(asked[1])
        least = min(least, float(np.linalg.norm(first.position - second.position)))
    return least


angles = st.floats(-math.pi, math.pi)
MET = 0.9 * MIN_M
"""What is left of the least distance when the aircraft are late [m]."""


@settings(max_examples=settings().max_examples // 8)  # a minute of flight each
@given(angles, st.floats(0.5, 4.0), st.floats(-20.0, 20.0), st.floats(-5.0, 5.0))
def test_ways_that_cross_at_whatever_angle(
    angle: float, speed: float, miss: float, higher: float
) -> None:
    """One passes the other: from behind, head on, from the side, aimed at it or not."""
    towards = np.array([math.cos(angle), math.sin(angle), 0.0])
    aside = np.array([-towards[1], towards[0], 0.0])
    first = Uav(np.zeros(3), np.array([40.0, 0.0, 0.0]))
    begin = -60.0 * towards + miss * aside + np.array([0.0, 0.0, higher])
    second = Uav(begin, first.velocity + speed * towards)
    distance = least_distance(first, second, 60.0 / speed + 30.0)
    assert distance >= MET
    passed = float((second.position - first.position) @ towards)
    assert passed > 0.0  # they do not block each other for good


def test_without_the_barrier_they_would_meet() -> None:
    first = Uav(np.zeros(3), np.array([40.0, 0.0, 0.0]), evades=False)
    second = Uav(np.array([-60.0, 0.0, 0.0]), np.array([43.0, 0.0, 0.0]), evades=False)
    assert least_distance(first, second, 40.0) < 0.1


@given(
    st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    st.tuples(*[st.floats(-60.0, 60.0)] * 3),
    st.tuples(*[st.floats(-60.0, 60.0)] * 3),
    st.tuples(*[st.floats(-60.0, 60.0)] * 3),
)
def test_the_approach_asked_for_is_within_the_bound(
    position: Vector, expected: Vector, velocity: Vector, theirs: Vector
) -> None:
    away = np.array(position)
    distance = float(np.linalg.norm(away))
    asked = evaded(expected, position, velocity, place(np.zeros(3), np.array(theirs)))
    if distance < 1e-3:
        return
    away = away / distance
    mean = 0.5 * float((np.array(velocity) + np.array(theirs)) @ away)
    bound = mean - 0.5 * RATE * (distance - MIN_M)
    if np.array(expected) @ away >= bound:
        assert asked == pytest.approx(expected)
    else:
        assert not np.array_equal(asked, expected)
        evading = 3.0 * abs(away[2])  # up or down, not always away from the other
        assert asked @ away >= bound - evading - 1e-6


def test_those_far_apart_or_forgotten_are_left_alone() -> None:
    expected, here = (40.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    far = place(np.array([100.0, 0.0, 0.0]), np.array([40.0, 0.0, 0.0]))
    near = place(np.array([16.0, 0.0, 0.0]), np.array([30.0, 0.0, 0.0]))
    assert evaded(expected, here, expected, far).tolist() == list(expected)
    assert evaded(expected, here, expected, near)[0] < 39.0
    aged = near.copy()
    aged["position"][0, 0] -= (
        30.0 * FORGOTTEN_S
    )  # it is there when its place is about to be forgotten
    last = round(FORGOTTEN_S / DT)
    assert evaded(expected, here, expected, aged, step=last)[0] < 39.0
    assert evaded(expected, here, expected, aged, step=last + 1).tolist() == list(expected)
    near["step"] = -1
    assert evaded(expected, here, expected, near).tolist() == list(expected)


@pytest.mark.parametrize("miss", [0.0, 8.0])
@pytest.mark.parametrize("speed", [2.0, 6.0])
def test_one_that_is_degraded_is_evaded_by_the_other_alone(speed: float, miss: float) -> None:
    """It comes nearer where only half of the evasion is left to the other."""
    ahead, aside = np.eye(3)[:2]

    def least(state: int) -> float:
        degraded = Uav(-30.0 * ahead, (40.0 + speed) * ahead, evades=False)
        other = Uav(miss * aside, 40.0 * ahead)
        nearest_m = math.inf
        for _ in range(round(15.0 / DT)):
            asked = degraded.ask([other], 0), other.ask([degraded], 1, state)
            degraded.move(asked[0])
            other.move(asked[1])
            nearest_m = min(nearest_m, float(np.linalg.norm(degraded.position - other.position)))
        return nearest_m

    known = least(4 * LOST + STAY)
    assert known >= MET
    assert known > least(0) + 2.0


@pytest.mark.parametrize("own", [0, 1])
def test_one_that_is_degraded_and_too_slow_to_be_followed_is_passed_above(own: int) -> None:
    expected, behind = (40.0, 0.0, 0.0), (-20.0, 0.0, 0.0)

    def climb(speed: float, state: int) -> float:
        theirs = place(np.zeros(3), np.array([speed, 0.0, 0.0]))
        return -float(evaded(expected, behind, expected, theirs, own, state=state)[2])

    degraded, usual = 4 * LOST + STAY, 3.0 if own == 0 else -3.0
    assert climb(MIN_AIRSPEED_M_S - 5.0, degraded) == pytest.approx(8.0)
    assert climb(MIN_AIRSPEED_M_S + 1.0, degraded) == pytest.approx(usual)
    assert climb(MIN_AIRSPEED_M_S - 5.0, 0) == pytest.approx(usual)


def test_the_nearest_member_is_where_it_has_gone_since_its_message() -> None:
    reported = np.concatenate(
        [
            place(np.array([-50.0, 0.0, 0.0]), np.array([40.0, 0.0, 0.0])),
            place(np.array([0.0, 30.0, 0.0]), np.array([0.0, 0.0, 0.0])),
        ]
    )
    here, (places, layout) = (0.0, 0.0, 0.0), seen(reported)
    assert nearest(here, places, layout, 0, DT) == (2, 30.0)
    m, distance = nearest(here, places, layout, round(1.0 / DT), DT)
    assert m == 1
    assert distance == pytest.approx(10.0)
    places["step"] = -1
    m, distance = nearest(here, places, layout, 0, DT)
    assert m == -1
    assert math.isnan(distance)

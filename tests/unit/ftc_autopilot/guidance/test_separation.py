"""Neighbours keep their distance, however their ways cross."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.separation import kept_apart, nearest
from mavlink_defs.framing.codec import NEIGHBOUR

DT = 0.02
LEAST_M, RATE = 15.0, 0.3
LAG_S = 0.4  # three times in a row, as the reference filter
Vector = tuple[float, float, float]


def message(position: np.ndarray, velocity: np.ndarray, step: int = 0) -> np.ndarray:
    told = np.zeros(1, NEIGHBOUR)
    told["step"], told["path_id"] = step, 7
    told["position"], told["ground_velocity"] = position, velocity
    return told


def evaded(
    wanted: Vector, position: Vector, velocity: Vector, others: np.ndarray, upwards: float = 1.0
) -> np.ndarray:
    ones = np.ones(len(others))
    result = kept_apart(
        wanted, position, velocity, others, ones, upwards * ones, 0.0, DT, LEAST_M, RATE
    )
    return np.array(result)


class Uav:
    """Flies velocities asked for, late, and asks for those that bring it to a moving place."""

    def __init__(self, place: np.ndarray, velocity: np.ndarray, evades: bool = True) -> None:
        self.place, self.velocity = place, velocity
        self.position = place.copy()
        self.lags = [velocity.copy() for _ in range(3)]
        self.evades = evades

    def ask(self, others: list["Uav"], upwards: float) -> np.ndarray:
        pull = 0.8 * (self.place - self.position)
        pull *= min(1.0, 8.0 / max(float(np.linalg.norm(pull)), 1e-9))
        wanted = self.velocity + pull
        if not self.evades:
            return np.asarray(wanted)
        told = np.concatenate([message(other.position, other.lags[-1]) for other in others])
        return evaded(tuple(wanted), tuple(self.position), tuple(self.lags[-1]), told, upwards)

    def move(self, asked: np.ndarray) -> None:
        for k, goal in enumerate([asked, *self.lags[:-1]]):
            self.lags[k] = self.lags[k] + DT / LAG_S * (goal - self.lags[k])
        self.position = self.position + DT * self.lags[-1]
        self.place = self.place + DT * self.velocity


def least_distance(first: Uav, second: Uav, time_s: float) -> float:
    least = math.inf
    for _ in range(round(time_s / DT)):
        asked = first.ask([second], 1.0), second.ask([first], -1.0)
        first.move(asked[0])
        second.move(asked[1])
        least = min(least, float(np.linalg.norm(first.position - second.position)))
    return least


angles = st.floats(-math.pi, math.pi)
MET = 0.9 * LEAST_M
"""What is left of the least distance when the aircraft are late [m]."""


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
    position: Vector, wanted: Vector, velocity: Vector, theirs: Vector
) -> None:
    away = np.array(position)
    distance = float(np.linalg.norm(away))
    asked = evaded(wanted, position, velocity, message(np.zeros(3), np.array(theirs)))
    if distance < 1e-3:
        return
    away = away / distance
    mean = 0.5 * float((np.array(velocity) + np.array(theirs)) @ away)
    bound = mean - 0.5 * RATE * (distance - LEAST_M)
    if np.array(wanted) @ away >= bound:
        assert asked == pytest.approx(wanted)
    else:
        assert not np.array_equal(asked, wanted)
        evading = 3.0 * abs(away[2])  # up or down, not always away from the other
        assert asked @ away >= bound - evading - 1e-6


def test_those_far_apart_silent_or_off_a_path_are_left_alone() -> None:
    wanted = (40.0, 0.0, 0.0)
    far = message(np.array([100.0, 0.0, 0.0]), np.array([40.0, 0.0, 0.0]))
    near = message(np.array([16.0, 0.0, 0.0]), np.array([30.0, 0.0, 0.0]))
    off_path = near.copy()
    off_path["path_id"] = 0
    assert evaded(wanted, (0.0, 0.0, 0.0), wanted, far).tolist() == list(wanted)
    assert evaded(wanted, (0.0, 0.0, 0.0), wanted, off_path).tolist() == list(wanted)
    assert evaded(wanted, (0.0, 0.0, 0.0), wanted, near)[0] < 39.0
    silent = np.zeros(1)
    up = np.ones(1)
    asked = kept_apart(wanted, (0.0, 0.0, 0.0), wanted, near, silent, up, 0.0, DT, LEAST_M, RATE)
    assert asked == wanted


def test_the_nearest_neighbour_is_where_it_has_gone_since_it_told() -> None:
    told = np.concatenate(
        [
            message(np.array([-50.0, 0.0, 0.0]), np.array([40.0, 0.0, 0.0])),
            message(np.array([0.0, 30.0, 0.0]), np.array([0.0, 0.0, 0.0])),
        ]
    )
    here, ones = (0.0, 0.0, 0.0), np.ones(2)
    assert nearest(here, told, ones, 0.0, DT) == (1, 30.0)
    d, distance = nearest(here, told, ones, 1.0, DT)
    assert d == 0
    assert distance == pytest.approx(10.0)
    d, distance = nearest(here, told, np.zeros(2), 0.0, DT)
    assert d == -1
    assert math.isnan(distance)

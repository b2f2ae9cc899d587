"""Neighbour messages by a trigger: what receivers extrapolate, and how wrong it can be."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.config import FormationTrigger
from ftc_autopilot.control.controller import parameter_record
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.neighbour_messages import (
    extrapolate,
    is_message_due,
    refer_to_reference,
)
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.triggers.static import PerChannel
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE
from mavlink_defs.framing.codec import NEIGHBOUR

DT = 0.001
TRIGGER = FormationTrigger(longest_silence_s=0.05)
RECORD = parameter_record(Proposed(), PerChannel(), TRIGGER)["formation_trigger"]

numbers = st.floats(-10.0, 10.0)


def message(step: int, airspeed: float, roll: float, rate: float = 0.0) -> np.void:
    record: np.void = np.zeros(1, NEIGHBOUR)[0]
    record["step"], record["airspeed"], record["airspeed_rate"] = step, airspeed, rate
    record["attitude"][0], record["attitude_rate"][0] = roll, rate
    return record


def later(broadcast: np.void, step: int) -> np.void:
    result: np.void = np.zeros(1, NEIGHBOUR)[0]
    extrapolate(broadcast, step, DT, result)
    return result


@given(numbers, numbers, numbers)
def test_at_its_own_step_a_message_says_exactly_what_it_said(
    airspeed: float, roll: float, rate: float
) -> None:
    broadcast = message(7, airspeed, roll, rate)
    now = later(broadcast, 7)
    for name in NEIGHBOUR.names or ():
        assert np.array_equal(now[name], broadcast[name]), name


@given(numbers, numbers, st.integers(0, 3000), st.integers(0, 3000))
def test_extrapolation_assumes_a_decaying_rate(
    roll: float, rate: float, first: int, second: int
) -> None:
    """In one stride or in two; and it never goes further than the rate for 0.1 s."""
    broadcast = message(0, 0.0, roll, rate)
    at_once = later(broadcast, first + second)
    in_two = later(later(broadcast, first), first + second)
    for name in ("attitude", "attitude_rate"):
        assert in_two[name][0] == pytest.approx(at_once[name][0], rel=1e-9, abs=1e-9)
    assert abs(at_once["attitude"][0] - roll) <= 0.1 * abs(rate) + 1e-12
    assert later(broadcast, 1)["attitude"][0] == pytest.approx(roll + DT * rate, abs=1e-4)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_receivers_are_wrong_by_no_more_than_the_thresholds(seed: int, lost: float) -> None:
    """With losses, once the next message has arrived; and none is awaited for longer than stated.

    Sender and receiver start from the same message, as after the exchange before the start.
    """
    random = np.random.default_rng(seed)
    broadcast = heard = message(0, 0.1, 3.1)
    roll, airspeed, complete = 3.1, 0.1, True
    for step in range(1, 400):
        roll += random.normal(0.0, 3e-4)
        airspeed += random.normal(0.0, 3e-3)
        angle = math.remainder(roll, 2.0 * math.pi)  # as an error is: it jumps at half a turn
        own = message(step, airspeed, angle, random.normal(0.0, 0.1))
        if is_message_due(own, broadcast, later(broadcast, step), DT, RECORD):
            broadcast = own
            complete = random.random() >= lost
            if complete:
                heard = own
        assert step - broadcast["step"] < TRIGGER.longest_silence_s / DT
        if complete:
            wrong = later(heard, step)
            limit = TRIGGER.airspeed_relative * abs(airspeed) + TRIGGER.airspeed_m_s
            assert abs(wrong["airspeed"] - airspeed) <= limit + 1e-12
            off = math.remainder(float(wrong["attitude"][0]) - angle, 2.0 * math.pi)
            degrees = TRIGGER.attitude_relative * abs(math.degrees(angle)) + TRIGGER.attitude_deg
            assert abs(math.degrees(off)) <= degrees + 1e-9


def test_a_message_is_due_when_something_is_off_or_after_the_longest_silence() -> None:
    broadcast = message(10, 0.0, 0.0)

    def due(own: np.void) -> bool:
        return is_message_due(own, broadcast, later(broadcast, int(own["step"])), DT, RECORD)

    assert not due(message(11, 0.0, 0.0))
    assert due(message(11, 0.03, 0.0))
    assert due(message(11, 0.0, math.radians(-0.06)))
    assert not due(message(11, 0.0, math.radians(0.04)))
    assert not due(message(59, 0.0, 0.0))
    assert due(message(60, 0.0, 0.0))
    other = message(11, 0.0, 0.0)
    other["frame"] = FTC_NEIGHBOUR_FRAME_REFERENCE  # as after arming
    assert due(other)
    assert not due(message(10, 9.0, 9.0))  # nothing is sent twice for one step


def test_half_a_turn_is_passed_without_a_message() -> None:
    broadcast, own = message(1, 0.0, math.pi - 1e-4), message(2, 0.0, 1e-4 - math.pi)
    assert not is_message_due(own, broadcast, later(broadcast, 2), DT, RECORD)


def test_own_errors_are_taken_from_the_step() -> None:
    own = message(3, 41.0, 0.5, rate=2.0)
    signals = np.zeros(1, SIGNALS)[0]
    signals["error"] = (1.0, 0.1, 0.2, 0.3)
    signals["reference_dot"] = (0.5, 0.25, 0.0, 0.0)
    refer_to_reference(own, signals)
    assert (own["airspeed"], own["airspeed_rate"]) == (1.0, 1.5)
    assert own["attitude"].tolist() == [0.1, 0.2, 0.3]
    assert own["attitude_rate"].tolist() == [1.75, 0.0, 0.0]
    assert (own["frame"], own["step"]) == (FTC_NEIGHBOUR_FRAME_REFERENCE, 3)


def on_path(step: int, xi: float = 100.0, north: float = 50.0) -> np.void:
    record = message(step, 0.0, 0.0)
    record["path_id"], record["path_position"], record["path_rate"] = 7, xi, 40.0
    record["position"], record["ground_velocity"] = (north, -3.0, -100.0), (40.0, 0.0, 0.5)
    record["report"][2] = 27
    return record


def test_places_go_on_at_the_reported_rates_and_the_report_stays() -> None:
    now = later(on_path(10), 60)
    assert now["path_position"] == pytest.approx(102.0)
    assert now["position"] == pytest.approx((52.0, -3.0, -99.975))
    assert (now["path_id"], now["report"][2]) == (7, 27)


def test_a_message_is_due_when_a_place_or_the_report_is_off() -> None:
    broadcast = on_path(10)

    def due(own: np.void) -> bool:
        return is_message_due(own, broadcast, later(broadcast, int(own["step"])), DT, RECORD)

    assert not due(on_path(35, 101.0, 51.0))
    assert due(on_path(35, 101.06, 51.0))
    assert due(on_path(35, 101.0, 51.51))
    other = on_path(35, 101.0, 51.0)
    other["report"][2] = 43
    assert due(other)
    left = message(35, 0.0, 0.0)
    assert due(left)  # it flies no path any more
    assert not is_message_due(message(36, 0.0, 0.0), left, later(left, 36), DT, RECORD)

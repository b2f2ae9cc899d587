import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.schedule import schedule_table, scheduled
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.reference import (
    filter_reference,
    profile_record,
    profile_segments,
    profile_value,
    start_filter,
)
from ftc_autopilot.control.triggers.static import PerChannel
from mavlink_defs.profile import Segment

SEGMENTS = (
    Segment(0.0, 40.0, 0.0, 0.0, 170.0, False),
    Segment(4.0, 50.0, 0.0, 0.0, -170.0, True),
    Segment(6.0, 45.0, 5.0, 5.0, -170.0, False),
)
PROFILE = profile_record(SEGMENTS)


def value_at(t: float) -> np.ndarray:
    value = np.zeros(4)
    profile_value(PROFILE, t, value)
    return value


def test_a_profile_comes_back_from_its_record() -> None:
    assert profile_segments(profile_record(SEGMENTS)) == SEGMENTS


@given(st.floats(-1e3, 1e3))
def test_wrap_gives_the_congruent_angle_within_half_a_turn(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)


@pytest.mark.parametrize(("t", "airspeed"), [(0.0, 40.0), (4.0, 40.0), (6.0, 50.0), (9.0, 45.0)])
def test_a_segment_starts_after_its_start_time(t: float, airspeed: float) -> None:
    assert value_at(t)[0] == airspeed


def test_a_ramp_goes_from_the_values_before_to_its_own_the_short_way_round() -> None:
    middle = value_at(5.0)
    assert middle[0] == 45.0
    assert wrap(middle[3]) == pytest.approx(math.pi)


def test_the_filter_starts_at_rest() -> None:
    x = np.full((4, 3), 7.0)
    start_filter(np.array([40.0, 0.1, -0.2, 3.0]), x)
    assert x[:, 0].tolist() == [40.0, 0.1, -0.2, 3.0]
    assert not x[:, 1:].any()


def test_the_filter_settles_on_the_command_without_overshoot() -> None:
    x = np.zeros((4, 3))
    start_filter(np.array([40.0, 0.0, 0.0, math.radians(170.0)]), x)
    command = np.array([45.0, 0.1, -0.1, math.radians(-170.0)])
    course = []
    for _ in range(10_000):
        filter_reference(command, x, 2.5, 1e-3)
        course.append(x[:, 0].copy())
    assert np.allclose(course[-1][:3], command[:3], atol=1e-6)
    assert course[-1][3] == pytest.approx(math.radians(190.0), abs=1e-6)  # turned by 20°, not 340°
    assert max(row[0] for row in course) <= 45.0 + 1e-9


@pytest.mark.parametrize(
    ("t", "a2", "K1"),
    [
        (0.0, 0.5, 50.0),
        (5.0, 0.5, 50.0),
        (14.0, 0.5, 45.0),
        (14.001, 1.0, 45.0),
        (15.001, 1.0, 40.0),
        (1e6, 1.0, 40.0),
    ],
)
def test_schedules_hold_to_the_end_of_their_windows(t: float, a2: float, K1: float) -> None:
    assert scheduled(schedule_table(PerChannel().a2_n), t)[0] == a2
    assert scheduled(schedule_table(Proposed().K1), t)[0] == K1

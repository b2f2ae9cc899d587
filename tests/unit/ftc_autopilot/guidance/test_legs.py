"""Lines and arcs that lead from one place to another."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.legs import Circle, Leg, Pose, approach, distance, tangent_course

metres = st.floats(-5000.0, 5000.0)
poses = st.builds(Pose, metres, metres, st.floats(-4.0, 4.0))
radii = st.floats(50.0, 2000.0)
circles = st.builds(Circle, metres, metres, radii | radii.map(lambda r: -r) | st.just(0.0))


def centre_of(pose: Pose, radius: float) -> tuple[float, float]:
    """Centre of the circle that is flown through a pose."""
    return (
        pose.north - radius * math.sin(pose.course),
        pose.east + radius * math.cos(pose.course),
    )


@given(poses, circles, radii)
def test_a_way_runs_into_the_circle_without_a_corner(
    pose: Pose, circle: Circle, radius: float
) -> None:
    way = approach(pose, circle, radius)
    if way is None:
        return
    at = pose
    for leg in way:
        assert leg.length_m > 0.0
        assert leg.curvature_1_m == 0.0 or abs(leg.curvature_1_m) == pytest.approx(1.0 / radius)
        assert leg[:3] == pytest.approx(at, abs=1e-6)
        at = leg.end
    assert len(way) <= 2
    assert distance(centre_of(at, circle.radius), circle) < 1e-4


@given(poses, circles)
def test_there_is_always_a_way_with_a_turn_like_the_circle(pose: Pose, circle: Circle) -> None:
    if circle.radius:
        assert approach(pose, circle, abs(circle.radius)) is not None


@given(poses, circles.filter(lambda circle: circle.radius == 0.0), radii)
def test_there_is_always_a_way_to_a_point(pose: Pose, point: Circle, radius: float) -> None:
    assert approach(pose, point, radius) is not None


@given(poses, metres, radii)
def test_straight_ahead_there_is_no_turn(pose: Pose, away: float, radius: float) -> None:
    north, east, _ = Leg(*pose, 0.0, abs(away) + 1.0).end
    way = approach(pose, Circle(north, east, 0.0), radius)
    assert way is not None
    assert sum(leg.length_m for leg in way) == pytest.approx(abs(away) + 1.0, rel=1e-6)


@given(poses, circles)
def test_a_tangent_touches_the_circle_on_the_side_it_is_flown(pose: Pose, circle: Circle) -> None:
    course = tangent_course(pose, circle)
    away = distance(pose, circle)
    assert (course is None) == (away <= abs(circle.radius))
    if course is not None:
        length = math.sqrt(away**2 - circle.radius**2)
        end = Leg(pose.north, pose.east, course, 0.0, length).end
        assert distance(centre_of(end, circle.radius), circle) < 1e-5


@given(poses, st.floats(-0.02, 0.02), st.floats(1.0, 3000.0), st.floats(0.0, 1.0))
def test_both_parts_of_a_cut_leg_are_the_leg(
    pose: Pose, curvature: float, length: float, share: float
) -> None:
    leg = Leg(*pose, curvature, length)
    first, second = leg.cut(share * length)
    assert first.end == pytest.approx(second[:3], abs=1e-6)
    assert second.end == pytest.approx(leg.end, abs=1e-6)

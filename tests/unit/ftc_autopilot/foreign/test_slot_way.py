"""The way of a slot beside its line."""

import math

import pytest

from ftc_autopilot.foreign.slot_way import Arc, SlotWay


@pytest.mark.parametrize("right_m", [-100.0, 0.0, 50.0, 100.0, 150.0])
def test_a_slot_at_the_centre_of_its_leaders_turn_has_a_way(right_m: float) -> None:
    """Its radius is the leader's less its place to the right; there, nothing is left of it."""
    line = Arc(0.0, 0.0, 0.0, 1.0 / 100.0, -100.0)
    way = SlotWay(line, -20.0, right_m, 40.0, (0.0, 0.0))
    arc = way.arc_at(0.0, 0.5)
    assert 1.0 / arc.curvature == pytest.approx(max(100.0 - right_m, 20.0))
    assert all(math.isfinite(value) for value in (arc.north, arc.east, arc.course))
    assert math.isfinite(way.pace(6.0).speed_m_s)

"""An attitude is the same after a whole turn, for the UAV itself and for its neighbours."""

import math
from typing import Any

import numpy as np
import pytest
from edges import edges_of
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.controller import parameter_record
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.synchronisation_errors import FormationErrors, formation_errors
from ftc_autopilot.control.triggers.static import PerChannel
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE
from mavlink_defs.framing.codec import NEIGHBOUR
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.vec3 import Vec3

LAW = Proposed()
WEIGHTING = parameter_record(LAW, PerChannel())["common"]
ZERO = (0.0, 0.0, 0.0)
ROLL, YAW = 0, 2

within = st.floats(-3.14, 3.14)
attitudes = st.tuples(within, st.floats(-1.5, 1.5), within)
turns = st.tuples(st.integers(-3, 3), st.just(0), st.integers(-3, 3))


def errors(nominal: np.void, own: Vec3, neighbours: list[Vec3]) -> FormationErrors:
    """Errors of a UAV with these attitudes [rad], the reference being level flight due north."""
    v = (45.0, 0.0, 0.0)
    motion = MeasuredMotion(v, own, ZERO, 45.0, 0.0, ZERO, ZERO, aerodynamics(v, ZERO, nominal))
    reports = np.zeros(len(neighbours), NEIGHBOUR)
    for row, attitude in zip(reports, neighbours, strict=True):
        row["airspeed"], row["attitude"] = 45.0, attitude
    reference = Reference(45.0, 0.0, ZERO, ZERO)
    return formation_errors(motion, reference, edges_of(reports), WEIGHTING)


def test_a_neighbour_on_its_own_reference_is_no_disagreement(nominal: np.void) -> None:
    """The one flies level to the North at 45 m/s, the other climbs to the East at 50 m/s."""
    v = (45.0, 0.0, 0.0)
    motion = MeasuredMotion(v, ZERO, ZERO, 45.0, 0.0, ZERO, ZERO, aerodynamics(v, ZERO, nominal))
    reports = np.zeros(1, NEIGHBOUR)
    reports["airspeed"], reports["attitude"] = 50.0, (0.3, 0.1, math.pi / 2)
    reference = Reference(45.0, 0.0, ZERO, ZERO)
    blind = formation_errors(motion, reference, edges_of(reports), WEIGHTING)
    assert abs(blind.e_prime[YAW]) > 0.1
    reports["airspeed"], reports["attitude"] = 0.0, 0.0
    reports["frame"] = FTC_NEIGHBOUR_FRAME_REFERENCE
    found = formation_errors(motion, reference, edges_of(reports), WEIGHTING)
    assert (found.V_tilde_prime, found.e_prime) == (0.0, ZERO)


def turned(attitude: Vec3, by: tuple[int, int, int]) -> Vec3:
    roll, pitch, yaw = (angle + 2.0 * math.pi * n for angle, n in zip(attitude, by, strict=True))
    return roll, pitch, yaw


@pytest.mark.parametrize("axis", [ROLL, YAW])
def test_two_uavs_close_to_half_a_turn_off_hardly_disagree(axis: int, nominal: np.void) -> None:
    own: Any = [0.0, 0.0, 0.0]
    other: Any = [0.0, 0.0, 0.0]
    own[axis], other[axis] = math.radians(179.0), math.radians(-179.0)
    e_prime = errors(nominal, (*own,), [(*other,)]).e_prime[axis]
    assert e_prime == pytest.approx(LAW.lambda3 * own[axis] + LAW.lambda4 * math.radians(-2.0))


@given(own=attitudes, other=attitudes, own_turns=turns, other_turns=turns)
def test_whole_turns_change_no_error(
    own: Vec3,
    other: Vec3,
    own_turns: tuple[int, int, int],
    other_turns: tuple[int, int, int],
    nominal: np.void,
) -> None:
    before = errors(nominal, own, [other])
    after = errors(nominal, turned(own, own_turns), [turned(other, other_turns)])
    assert after.e == pytest.approx(before.e, abs=1e-12)
    half = math.pi * LAW.lambda4
    for ours, theirs, e in zip(after.e_prime, before.e_prime, before.e, strict=True):
        if abs(abs(theirs - LAW.lambda3 * e) - half) > 1e-9:  # at half a turn either way is right
            assert ours == pytest.approx(theirs, abs=1e-11)


@given(own=attitudes, other=attitudes)
def test_differences_within_half_a_turn_are_exact(own: Vec3, other: Vec3, nominal: np.void) -> None:
    own = (own[0] / 2.0, own[1], own[2] / 2.0)
    other = (other[0] / 2.0, other[1], other[2] / 2.0)
    found = errors(nominal, own, [other])
    assert found.e == own
    for e_prime, e, e_j in zip(found.e_prime, own, other, strict=True):
        assert e_prime == LAW.lambda3 * e + LAW.lambda4 * (0.0 + 1.0 * (e - e_j))

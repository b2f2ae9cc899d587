"""Coupled surfaces: who has them, and moves of both that turn about one axis only."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ftc_autopilot.control.heading import remaining_side_force
from ftc_autopilot.control.pairing import (
    is_coupled,
    joint_moves,
    relative_gain,
    surfaces_by_sideslip,
)
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.bundled import aircraft_names
from mavlink_defs.config.inherit import merged
from sitl_plant.airframe.aerodynamics import aerodynamics, force, moment
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import angular_acceleration
from sitl_plant.vec3 import Vec3, mat3

COUPLED = "aerosonde_first_edition"
AT_REST = (0.0, 0.0, 0.0)


def changed(name: str, **values: Any) -> Aircraft:
    return Aircraft.model_validate(merged(load_aircraft(name).model_dump(), values))


def turning(aircraft: Aircraft, aileron: float, rudder: float, beta: float = 0.0) -> Vec3:
    """Angular acceleration [rad/s²] by the plant's equations, in 25 m/s, without any rates."""
    record = aircraft_record(aircraft)
    v = 25.0 * math.cos(beta), 25.0 * math.sin(beta), 0.0
    air = aerodynamics(v, AT_REST, record)
    found = moment(air, (aileron, 0.0, rudder))
    result: Vec3 = angular_acceleration(AT_REST, found, mat3(record["J"]), mat3(record["J_inv"]))
    return result


def test_the_relative_gain_is_that_of_the_coefficients() -> None:
    """Rolling moment by the aileron alone, by that with a rudder that makes up for the yawing."""
    c = load_aircraft(COUPLED).coefficients
    rudder = -c.cn_da / c.cn_dr
    assert relative_gain(load_aircraft(COUPLED)) == pytest.approx(
        c.cl_da / (c.cl_da + c.cl_dr * rudder)
    )
    assert relative_gain(load_aircraft(COUPLED)) == pytest.approx(0.289, abs=1e-3)


def test_who_is_coupled() -> None:
    assert [name for name in aircraft_names() if is_coupled(load_aircraft(name))] == [COUPLED]
    assert not is_coupled(changed(COUPLED, surface_limits_deg={"rudder": "none"}))
    for nothing in ({"cn_dr": 0.0}, {"cl_da": 0.0}, {"cl_dr": 0.08, "cn_dr": 0.06}):
        assert not is_coupled(changed(COUPLED, coefficients=nothing)), nothing
    assert is_coupled(changed(COUPLED, coefficients={"cn_da": -0.06, "cl_dr": 0.02}))


@given(*[st.floats(-0.2, 0.2)] * 4, st.floats(-0.5, 0.5))
def test_a_joint_move_turns_about_its_axis_only(
    cl_da: float, cl_dr: float, cn_da: float, cn_dr: float, Jxz: float
) -> None:
    assume(abs(cl_da * cn_dr - cl_dr * cn_da) > 1e-3)
    coefficients = {"cl_da": cl_da, "cl_dr": cl_dr, "cn_da": cn_da, "cn_dr": cn_dr}
    inertia = {"inertia_kg_m2": {"Jxz": Jxz}, "any_inertia": True}
    aircraft = changed(COUPLED, coefficients=coefficients, **inertia)
    moves = joint_moves(aircraft)
    assert np.abs(moves).max(axis=1) == pytest.approx(1.0)
    for row, (own, other) in enumerate(((0, 2), (2, 0))):
        turned = turning(aircraft, *(0.1 * moves[row]))
        assert abs(turned[other]) < 1e-9 * abs(turned[own])


@given(*[st.floats(-0.2, 0.2)] * 4)
def test_coupled_surfaces_balance_sideslip(
    cl_da: float, cl_dr: float, cn_da: float, cn_dr: float
) -> None:
    coefficients = {"cl_da": cl_da, "cl_dr": cl_dr, "cn_da": cn_da, "cn_dr": cn_dr, "cY_da": 0.1}
    aircraft = changed(COUPLED, coefficients=coefficients)
    assume(is_coupled(aircraft) and abs(cl_da * cn_dr - cl_dr * cn_da) > 1e-3)
    beta = 0.02
    aileron, rudder = (beta * by for by in surfaces_by_sideslip(aircraft))
    unbalanced = turning(aircraft, 0.0, 0.0, beta)
    balanced = turning(aircraft, aileron, rudder, beta)
    assert abs(balanced[0]) + abs(balanced[2]) < 0.01 * (abs(unbalanced[0]) + abs(unbalanced[2]))
    record = aircraft_record(aircraft)
    air = aerodynamics((25.0 * math.cos(beta), 25.0 * math.sin(beta), 0.0), AT_REST, record)
    side = force(air, (aileron, 0.0, rudder))[1]
    assert remaining_side_force(aircraft, 25.0) * beta == pytest.approx(side, rel=0.1, abs=1.0)


def test_without_coupling_the_rudder_alone_is_reckoned_with() -> None:
    c = load_aircraft("aerosonde").coefficients
    assert surfaces_by_sideslip(load_aircraft("aerosonde")) == (0.0, -c.cn_beta / c.cn_dr)
    powerless = changed("aerosonde", coefficients={"cn_dr": 0.0})
    assert math.isnan(surfaces_by_sideslip(powerless)[1])

"""Steady flights with an actuator stuck stay as they are when the plant flies them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario
from mavlink_defs.constants import Actuator
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import largest_thrust, level_flight
from sitl_plant.airframe.rigid_body import STILL_AIR, State, advance, state_derivative
from sitl_plant.airframe.stuck_trim import Trim, stuck_range, trim_stuck

REST = (0.0, 0.0, 0.0)


def flown(trim: Trim, aircraft: Aircraft, seconds: float = 0.5) -> State:
    """The state after some time, by Euler steps of 0.1 ms: a trim's derivative is constant."""
    record = aircraft_record(aircraft)
    alpha, beta = math.radians(trim.alpha_deg), math.radians(trim.beta_deg)
    V = trim.airspeed_m_s
    v = (
        V * math.cos(alpha) * math.cos(beta),
        V * math.sin(beta),
        V * math.sin(alpha) * math.cos(beta),
    )
    roll, pitch = math.radians(trim.roll_deg), math.radians(trim.pitch_deg)
    turn = math.radians(trim.turn_rate_deg_s)
    omega = (
        -turn * math.sin(pitch),
        turn * math.sin(roll) * math.cos(pitch),
        turn * math.cos(roll) * math.cos(pitch),
    )
    state: State = (REST, v, (roll, pitch, 0.0), omega)
    radians = math.radians
    delta = (radians(trim.aileron_deg), radians(trim.elevator_deg), radians(trim.rudder_deg))
    for _ in range(round(seconds * 1e4)):
        slope = state_derivative(state, trim.thrust_n, delta, REST, REST, STILL_AIR, record)
        state = advance(state, 1e-4, slope)
    return state


@pytest.mark.parametrize(
    ("stuck", "position"),
    [
        ("aileron", 0.0),
        ("aileron", 12.0),
        ("rudder", 0.0),
        ("rudder", -20.0),
        ("elevator", 0.0),
        ("elevator", -25.0),
        ("throttle", 500.0),
    ],
)
@pytest.mark.parametrize("roll", [0.0, 20.0])
def test_a_trim_is_steady_and_level(
    scenario1: Scenario, stuck: Actuator, position: float, roll: float
) -> None:
    trim = trim_stuck(scenario1.aircraft, stuck, position, 45.0, roll)
    assert trim is not None
    assert trim.position == pytest.approx(position)
    p, v, phi, _ = flown(trim, scenario1.aircraft)
    assert np.linalg.norm(v) == pytest.approx(trim.airspeed_m_s, abs=1e-3)
    assert p[2] == pytest.approx(0.0, abs=1e-3)  # neither climb nor descent
    expected = (roll, trim.pitch_deg, 0.5 * trim.turn_rate_deg_s)
    assert np.degrees(phi) == pytest.approx(expected, abs=1e-2)


@given(st.floats(-2.0, 20.0), st.sampled_from([25.0, 40.0, 60.0]))
def test_rudder_by_aileron_from_the_two_moments(
    scenario1: Scenario, aileron: float, airspeed: float
) -> None:
    """Without roll and rotation damping, cl = cn = 0 gives it by Cramer's rule."""
    a = scenario1.aircraft.coefficients
    trim = trim_stuck(scenario1.aircraft, "aileron", aileron, airspeed)
    assert trim is not None
    rate = math.radians(trim.turn_rate_deg_s) * math.cos(math.radians(trim.pitch_deg))
    roll_rate = -math.radians(trim.turn_rate_deg_s) * math.sin(math.radians(trim.pitch_deg))
    half = scenario1.aircraft.wing_span_m / (2.0 * airspeed)
    known = [
        -(a.cl0 + a.cl_da * math.radians(aileron) + half * (a.cl_r * rate + a.cl_p * roll_rate)),
        -(a.cn0 + a.cn_da * math.radians(aileron) + half * (a.cn_r * rate + a.cn_p * roll_rate)),
    ]
    beta, rudder = np.linalg.solve([[a.cl_beta, a.cl_dr], [a.cn_beta, a.cn_dr]], known)
    assert (trim.beta_deg, trim.rudder_deg) == pytest.approx(np.degrees([beta, rudder]), abs=1e-6)


def test_the_papers_aircraft_without_aileron(scenario1: Scenario) -> None:
    trim = trim_stuck(scenario1.aircraft, "aileron", 0.0, 50.0)
    assert trim is not None
    assert not trim.beyond
    found = (trim.rudder_deg, trim.beta_deg, trim.turn_rate_deg_s)
    assert found == pytest.approx((29.4, 8.7, -11.2), abs=0.05)
    ends = stuck_range(scenario1.aircraft, "aileron", 50.0)
    assert ends is not None
    assert [end.position for end in ends] == pytest.approx([-2.49, 28.2], abs=0.05)
    assert [abs(end.rudder_deg) for end in ends] == pytest.approx([35.0, 35.0], abs=0.01)
    beyond = trim_stuck(scenario1.aircraft, "aileron", -4.0, 50.0)
    assert beyond is not None
    assert beyond.beyond == ("rudder",)


def test_thrust_ends_what_the_elevator_permits(scenario1: Scenario) -> None:
    ends = stuck_range(scenario1.aircraft, "elevator")
    assert ends is not None
    assert ends[0].position == -35.0  # its own stop
    assert ends[1].thrust_n == pytest.approx(scenario1.aircraft.thrust_limit_n, rel=1e-4)
    least = stuck_range(scenario1.aircraft, "throttle")
    assert least is not None
    assert least[0].elevator_deg == pytest.approx(-35.0, abs=0.01)


@pytest.mark.parametrize("position", [8.0, -6.0])
def test_what_cannot_be_trimmed_cannot_be_flown(scenario1: Scenario, position: float) -> None:
    """The law keeps what `trim_stuck` says is possible, and nothing keeps the rest."""
    trim = trim_stuck(scenario1.aircraft, "aileron", position, 50.0)
    fault = {"uav": 3, "actuator": "aileron", "stuck_deg": position, "start_s": 17.0}
    tree = scenario1.model_dump() | {"controller": {"kind": "surviving"}, "faults": [fault]}
    flight = fly_in_process(Scenario.model_validate(tree))
    roll = np.degrees(np.abs(flight.error("reference")[:, 2, 1]))
    survived = flight.loss is None and roll.max() < 45.0
    assert trim is not None
    assert survived == (not trim.beyond)


@pytest.mark.parametrize("limit_deg", [5.0, 15.0])
def test_a_range_ends_where_the_sideslip_is_as_large_as_it_may_be(
    scenario1: Scenario, limit_deg: float
) -> None:
    aircraft = scenario1.aircraft
    ends = stuck_range(aircraft, "aileron", sideslip_limit_deg=limit_deg)
    anywhere = stuck_range(aircraft, "aileron")
    assert ends is not None
    assert anywhere is not None
    assert max(abs(trim.beta_deg) for trim in ends) == pytest.approx(limit_deg, abs=0.05)
    assert ends[1].position < anywhere[1].position
    beyond = trim_stuck(aircraft, "aileron", 20.0, sideslip_limit_deg=limit_deg)
    assert beyond is not None
    assert beyond.beyond == ("sideslip",)


def test_without_a_rudder_the_bank_balances_a_stuck_aileron() -> None:
    """A flying wing then turns; with its elevator where it trims 18 m/s it flies level at that."""
    x8 = load_aircraft("skywalker_x8")
    turning = trim_stuck(x8, "aileron", 2.0, 18.0)
    assert turning is not None
    assert turning.rudder_deg == 0.0
    other = trim_stuck(x8, "aileron", -2.0, 18.0)
    assert other is not None
    assert turning.roll_deg == pytest.approx(-other.roll_deg, rel=0.02)
    assert abs(turning.roll_deg) > 5.0
    assert turning.turn_rate_deg_s == pytest.approx(-other.turn_rate_deg_s, rel=0.02)
    flight = level_flight(x8, 18.0)
    assert flight is not None
    straight = trim_stuck(x8, "elevator", flight.elevator_deg, 20.0)
    assert straight is not None
    assert straight.airspeed_m_s == pytest.approx(18.0, abs=1e-4)
    assert straight.alpha_deg == pytest.approx(flight.alpha_deg, abs=1e-4)


def test_a_flight_that_takes_more_thrust_than_there_is_there_is_none() -> None:
    """With the aileron stuck, at an airspeed at which the propeller is too weak."""
    aerosonde = load_aircraft("aerosonde_propeller")
    rows = [{"airspeed_m_s": 20.0, "thrust_n": 50.0}, {"airspeed_m_s": 28.0, "thrust_n": 5.0}]
    weak = Aircraft.model_validate(aerosonde.model_dump() | {"propulsion": {"thrust": rows}})
    for V, beyond in ((20.0, ()), (28.0, ("throttle",))):
        trim = trim_stuck(weak, "aileron", 0.5, V)
        assert trim is not None
        assert trim.beyond == beyond
        assert (trim.thrust_n > 5.0) or V == 20.0


def test_a_stuck_throttle_makes_no_more_than_the_airspeed_permits() -> None:
    """Stuck open, the aircraft flies as fast as its propeller pulls it, whatever is asked for."""
    aircraft = load_aircraft("aerosonde_propeller").model_copy(update={"airspeed_max_m_s": 45.0})
    trims = [trim_stuck(aircraft, "throttle", thrust, 28.0) for thrust in (40.0, 60.0)]
    assert trims[0] is not None
    assert trims[1] is not None
    assert trims[0].airspeed_m_s == pytest.approx(trims[1].airspeed_m_s, abs=1e-6)
    flight = level_flight(aircraft, trims[0].airspeed_m_s)
    assert flight is not None
    assert flight.thrust_n == pytest.approx(largest_thrust(aircraft, trims[0].airspeed_m_s))

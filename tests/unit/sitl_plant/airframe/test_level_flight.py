"""Trim and modes of level flight against textbook approximations and the plant itself."""

import math

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import scenario_of, scenario_tree
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import (
    authority,
    fastest_level_flight,
    largest_thrust,
    level_flight,
)
from sitl_plant.airframe.modes import modes
from sitl_plant.airframe.rigid_body import STILL_AIR, state_derivative

V = 25.0
REST = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def aerosonde() -> Aircraft:
    return load_aircraft("aerosonde")


@pytest.mark.parametrize(("name", "speed"), [("aerosonde", V), ("paper", 45.0)])
def test_a_trim_is_at_rest(name: str, speed: float) -> None:
    aircraft = load_aircraft(name)
    flight = level_flight(aircraft, speed)
    assert flight is not None
    alpha = math.radians(flight.alpha_deg)
    assert flight.beta_deg == pytest.approx(0.0, abs=1e-6)
    delta = [math.radians(x) for x in (flight.aileron_deg, flight.elevator_deg, flight.rudder_deg)]
    v = (speed * math.cos(alpha), 0.0, speed * math.sin(alpha))
    climb, v_dot, _, omega_dot = state_derivative(
        (REST, v, (0.0, alpha, 0.0), REST), flight.thrust_n, (delta[0], delta[1], delta[2]),
        REST, REST, STILL_AIR, aircraft_record(aircraft),
    )  # fmt: skip
    assert [*v_dot, *omega_dot, climb[2]] == pytest.approx([0.0] * 7, abs=1e-6)


def test_the_x8_trims_as_its_source_says() -> None:
    """`u_trim` and `y_trim` of simX8.m: elevator 0.0370 rad, u = 17.9914 and w = 0.5551 m/s."""
    flight = level_flight(load_aircraft("skywalker_x8"), math.hypot(17.9914, 0.5551))
    assert flight is not None
    assert math.radians(flight.elevator_deg) == pytest.approx(0.0370, abs=5e-5)
    assert math.radians(flight.alpha_deg) == pytest.approx(math.atan2(0.5551, 17.9914), abs=5e-5)
    thrust = 0.5 * 1.225 * 0.10178760197630929  # of its fan at a throttle of 0.1219
    leaving = 18.0 + 0.1219 * (40.0 - 18.0)
    assert flight.thrust_n == pytest.approx(thrust * leaving * (leaving - 18.0), rel=2e-3)


def test_without_a_rudder_a_bank_balances_what_is_not_symmetric() -> None:
    tree = load_aircraft("skywalker_x8").model_dump()
    tree["coefficients"] |= {"cn0": 0.002, "cl0": 0.001}
    aircraft = Aircraft.model_validate(tree)
    flight = level_flight(aircraft, 18.0)
    assert flight is not None
    assert flight.rudder_deg == 0.0
    assert abs(flight.roll_deg) > 0.1
    c, beta = aircraft.coefficients, math.radians(flight.beta_deg)
    yawing = c.cn0 + c.cn_beta * beta + c.cn_da * math.radians(flight.aileron_deg)
    assert yawing == pytest.approx(0.0, abs=1e-7)


def test_no_flight_is_invented_beyond_the_model(aerosonde: Aircraft) -> None:
    """150 kg would take an angle of attack of 76°."""
    assert level_flight(aerosonde.model_copy(update={"mass_kg": 150.0}), V) is None


def test_modes_are_those_of_the_approximations(aerosonde: Aircraft) -> None:
    """Short period √(M_q Z_α - M_α), phugoid √2 g/V, roll L_p, dutch roll √N_β."""
    flight = level_flight(aerosonde, V)
    assert flight is not None
    found = {mode.name: mode for mode in modes(aerosonde, flight)}
    a, c = aerosonde, aerosonde.coefficients
    qS = 0.5 * a.air_density_kg_m3 * V**2 * a.wing_area_m2
    J = a.inertia_kg_m2
    rate_b, rate_c = a.wing_span_m / (2.0 * V), a.mean_chord_m / (2.0 * V)
    M_alpha = qS * a.mean_chord_m * c.cm_alpha / J.Jyy
    M_q = qS * a.mean_chord_m * c.cm_q * rate_c / J.Jyy
    Z_alpha = -qS * c.cL_alpha / a.mass_kg / V
    assert found["short period"].frequency_rad_s == pytest.approx(
        math.sqrt(M_q * Z_alpha - M_alpha), rel=0.05
    )
    assert found["phugoid"].frequency_rad_s == pytest.approx(math.sqrt(2.0) * 9.81 / V, rel=0.15)
    L_p = qS * a.wing_span_m * c.cl_p * rate_b / J.Jxx
    assert found["roll"].frequency_rad_s == pytest.approx(-L_p, rel=0.1)
    N_beta = qS * a.wing_span_m * c.cn_beta / J.Jzz
    assert found["dutch roll"].frequency_rad_s == pytest.approx(math.sqrt(N_beta), rel=0.25)
    assert set(found) == {"short period", "phugoid", "roll", "dutch roll", "spiral"}
    assert all(-1.0 <= mode.damping <= 1.0 for mode in found.values())


@pytest.mark.parametrize("factor", [1.0, 5.0, 20.0])
def test_modes_are_named_by_what_moves_not_by_count(aerosonde: Aircraft, factor: float) -> None:
    """Much pitch damping splits the short period; what swings then is the phugoid alone."""
    c = aerosonde.coefficients
    damped = c.model_copy(update={"cm_q": factor * c.cm_q})
    aircraft = aerosonde.model_copy(update={"coefficients": damped})
    flight = level_flight(aircraft, V)
    assert flight is not None
    found = modes(aircraft, flight)
    fast = [mode for mode in found if mode.name == "short period"]
    (phugoid,) = (mode for mode in found if mode.name == "phugoid")
    assert len(fast) == (1 if factor == 1.0 else 2)
    assert not phugoid.is_aperiodic
    assert phugoid.frequency_rad_s < 0.2 * min(mode.frequency_rad_s for mode in fast)


def test_authority_is_what_a_full_deflection_makes(aerosonde: Aircraft) -> None:
    c, J = aerosonde.coefficients, aerosonde.inertia_kg_m2
    qS = 0.5 * 1.2682 * V**2 * 0.55
    expected = qS * aerosonde.mean_chord_m * abs(c.cm_de) / J.Jyy * math.radians(25.0)
    assert authority(aerosonde, V)["elevator"] == pytest.approx(expected)


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("hardware", [(), ("realistic",)])
def test_an_aerosonde_flies_under_laws_that_were_made_on_another_aircraft(
    law: str, hardware: tuple[str, ...]
) -> None:
    tree = scenario_tree("airframes/aerosonde")
    for addition in (law, *hardware):
        tree |= scenario_tree(addition)
    flight = fly_in_process(scenario_of("aerosonde", tree))
    assert flight.loss is None
    errors = np.degrees(np.abs(flight.error("reference")[1000:, :, 1:]))
    assert np.all(errors.max(axis=(0, 1)) < (1.5, 1.0, 1.5))  # roll, pitch, yaw
    events = np.count_nonzero(flight.signals["events"]) / 3
    assert events < {"surviving": 550, "tube": 200}[law]


def with_thrust(aircraft: Aircraft, *rows: tuple[float, float]) -> Aircraft:
    thrust = [{"airspeed_m_s": V, "thrust_n": T} for V, T in rows]
    return Aircraft.model_validate(aircraft.model_dump() | {"propulsion": {"thrust": thrust}})


def test_a_level_flight_is_found_whether_the_thrust_suffices_or_not(aerosonde: Aircraft) -> None:
    """So that it can be said how much is missing; modes are those of a thrust that is held."""
    weak, flight = with_thrust(aerosonde, (10.0, 9.0), (40.0, 1.0)), level_flight(aerosonde, V)
    assert flight is not None
    assert level_flight(weak, V) == flight
    assert largest_thrust(weak, V) == 5.0
    assert flight.thrust_n > 5.0
    assert modes(weak, flight) == modes(aerosonde, flight)


def test_the_fastest_level_flight_takes_all_the_thrust(aerosonde: Aircraft) -> None:
    assert fastest_level_flight(aerosonde) == aerosonde.airspeed_max_m_s
    falling = with_thrust(aerosonde, (18.0, 30.0), (30.0, 5.0))
    fastest = fastest_level_flight(falling)
    assert fastest is not None
    assert 24.0 < fastest < 29.0
    flight = level_flight(falling, fastest)
    assert flight is not None
    assert flight.thrust_n == pytest.approx(largest_thrust(falling, fastest), abs=0.05)
    assert fastest_level_flight(with_thrust(aerosonde, (18.0, 1.0), (30.0, 1.0))) is None

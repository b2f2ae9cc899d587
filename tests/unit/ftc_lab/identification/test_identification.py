"""Identification of aircraft whose coefficients are known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ftc_lab.identification.experiment import experiment, stall_of
from ftc_lab.identification.fit import fit
from ftc_lab.identification.identified import (
    SET_BY_TRIM,
    Choices,
    Identified,
    identify,
    text_of,
    verdict,
)
from ftc_lab.identification.readings import Readings, windows_of
from ftc_lab.identification.trim import trim
from gcs.console.errors import BadInput
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.config.files import parse
from sitl_plant.airframe.config import TERMS, Aircraft
from sitl_plant.airframe.level_flight import level_flight
from sitl_plant.simulators.own import OwnSimulator

V = 24.0
MOMENTS = [name for axis in ("cl", "cm", "cn") for name in TERMS[axis]]


@pytest.fixture(scope="module")
def aerosonde() -> Aircraft:
    return load_aircraft("aerosonde")


@pytest.fixture(scope="module")
def identified(aerosonde: Aircraft) -> Identified:
    return identify(OwnSimulator(aerosonde), Choices(V, source="a test"))


def changed(aircraft: Aircraft, **coefficients: float) -> Aircraft:
    parts = aircraft.coefficients.model_copy(update=coefficients)
    return aircraft.model_copy(update={"coefficients": parts})


def test_a_trim_is_the_one_of_the_equations(aerosonde: Aircraft) -> None:
    found, known = trim(OwnSimulator(aerosonde), V), level_flight(aerosonde, V)
    assert known is not None
    assert math.degrees(found.alpha) == pytest.approx(known.alpha_deg, abs=0.01)
    assert math.degrees(found.delta[1]) == pytest.approx(known.elevator_deg, abs=0.02)
    assert found.thrust == pytest.approx(known.thrust_n, rel=0.01)
    assert found.gravity == aerosonde.gravity_m_s2


@pytest.mark.parametrize(("name", "airspeed"), [("aerosonde", V), ("paper", 45.0)])
def test_coefficients_come_back(name: str, airspeed: float) -> None:
    """Forces as well as moments, although the constants follow from the trim."""
    aircraft = load_aircraft(name)
    found = identify(OwnSimulator(aircraft), Choices(airspeed))
    known, values = aircraft.coefficients.model_dump(), found.aircraft.coefficients.model_dump()
    for key, value in known.items():
        assert values[key] == pytest.approx(value, rel=2e-3, abs=2e-4), key
    assert all(left.share < 1e-3 for left in found.fit.residuals.values())


def test_what_is_identified_trims_where_the_plant_does(identified: Identified) -> None:
    assert identified.level is not None
    assert identified.flight.alpha_deg == pytest.approx(
        math.degrees(identified.level.alpha), abs=0.02
    )
    assert identified.flight.thrust_n == pytest.approx(identified.level.thrust, rel=0.01)


def test_the_file_is_an_aircraft_and_the_same_every_time(
    identified: Identified, aerosonde: Aircraft
) -> None:
    text = text_of(identified, "gcs identify own:aerosonde")
    assert Aircraft.model_validate(parse("x", text)) == identified.aircraft
    again = identify(OwnSimulator(aerosonde), Choices(V, source="a test"))
    assert text_of(again, "gcs identify own:aerosonde") == text
    other = identify(OwnSimulator(aerosonde), Choices(V, source="a test", seed=2))
    assert other.fit != identified.fit


def noisy(readings: Readings, rng: np.random.Generator) -> Readings:
    rates = np.radians(0.3) * rng.standard_normal(readings.omega.shape)
    forces = 0.2 * rng.standard_normal(readings.force.shape)
    return replace(readings, omega=readings.omega + rates, force=readings.force + forces)


def test_intervals_hold_the_truth_in_95_of_100(aerosonde: Aircraft) -> None:
    """Of 16 experiments with a noise of 0.3 deg/s and 0.2 m/s²; a binomial bound of four sigma."""
    simulator = OwnSimulator(aerosonde)
    level, known = trim(simulator, V), aerosonde.coefficients.model_dump()
    experiments, inside, counted = 16, 0, 0
    for seed in range(experiments):
        readings = noisy(experiment(simulator, level, seed), np.random.default_rng(seed))
        found = fit(windows_of(readings, simulator.body))
        for name, one in found.estimates.items():
            inside += abs(one.value - known[name]) <= one.half_width
            counted += 1
        for name in MOMENTS:
            if abs(known[name]) > 0.01:
                value = found.estimates[name].value
                assert value == pytest.approx(known[name], rel=0.04, abs=1e-3), name
    spread = 4.0 * math.sqrt(0.95 * 0.05 / counted * len(TERMS))  # those of one axis go together
    assert 0.95 - spread < inside / counted < min(0.95 + spread, 1.0)


def test_more_noise_widens_the_intervals(aerosonde: Aircraft, identified: Identified) -> None:
    simulator = OwnSimulator(aerosonde)
    readings = noisy(experiment(simulator, trim(simulator, V), 1), np.random.default_rng(1))
    found = fit(windows_of(readings, simulator.body))
    for name, one in found.estimates.items():
        assert one.half_width > identified.fit.estimates[name].half_width


def test_a_stall_is_found(aerosonde: Aircraft) -> None:
    stalling = aerosonde.model_copy(update={"stall_deg": 15.0, "stall_sharpness": 100.0})
    simulator = OwnSimulator(stalling)
    found = stall_of(simulator, trim(simulator, V))
    assert found is not None
    assert 12.0 < math.degrees(found) <= 15.0
    endless = OwnSimulator(aerosonde.model_copy(update={"stall_deg": None}))
    assert stall_of(endless, trim(endless, V)) is None


def test_an_unstable_sideslip_is_told(aerosonde: Aircraft, identified: Identified) -> None:
    assert "nothing speaks against it" in verdict(identified)[0]
    found = identify(OwnSimulator(changed(aerosonde, cY_beta=0.1)), Choices(V))
    assert any("hold the heading by bank" in line for line in verdict(found))


def test_no_flight_is_promised_that_design_refuses(identified: Identified) -> None:
    """An aircraft that meets every check, but is slower than the laws were meant for."""
    inertia = identified.aircraft.inertia_kg_m2
    heavy = inertia.model_copy(update={k: 100.0 * J for k, J in inertia.model_dump().items()})
    aircraft = identified.aircraft.model_copy(update={"inertia_kg_m2": heavy})
    (line,) = verdict(replace(identified, aircraft=aircraft))
    assert "`gcs design` refuses it" in line
    assert "derives a flight" not in text_of(replace(identified, aircraft=aircraft), "x")


def test_what_has_no_trim_is_refused_with_the_reason(aerosonde: Aircraft) -> None:
    with pytest.raises(BadInput, match="the elevator would have to pass the stop"):
        identify(OwnSimulator(changed(aerosonde, cm0=0.8)), Choices(V))
    with pytest.raises(BadInput, match="no level flight at 3 m/s"):
        identify(OwnSimulator(aerosonde), Choices(3.0))


def test_set_by_trim_are_the_constants() -> None:
    assert {
        name for names in TERMS.values() for name, of in names.items() if of == "1"
    } == SET_BY_TRIM


def test_the_file_of_an_inertia_of_no_rigid_body_says_so(identified: Identified) -> None:
    assert "any_inertia" not in text_of(identified, "a test")
    simulator = OwnSimulator(load_aircraft("skywalker_x8"))
    text = text_of(identify(simulator, Choices(18.0, source="a test")), "a test")
    assert "\nany_inertia: true\n" in text
    found = Aircraft.model_validate(parse("x", text))
    assert found.inertia_kg_m2 == simulator.body.inertia_kg_m2

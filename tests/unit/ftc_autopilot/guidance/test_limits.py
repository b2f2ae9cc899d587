"""What can be flown: the limits of turns, by their defining inequality."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.limits import (
    FlightLimits,
    airspeeds_for,
    level_airspeed,
    tightest_turn,
    turn_radius,
)
from gcs.scenario.model import Scenario

LIMITS = st.builds(
    FlightLimits,
    cruise_m_s=st.just(40.0),
    bank_rad=st.floats(math.radians(15.0), math.radians(65.0)),
    level_m_s=st.floats(15.0, 29.0),
    climb=st.just(0.2),
    wind_m_s=st.floats(0.0, 15.0),
    offset_m=st.floats(0.0, 100.0),
    gravity_m_s2=st.just(9.8),
    slowest_m_s=st.just(0.0),
    fastest_m_s=st.just(math.inf),
)


def bank_deg(airspeed: float, radius: float, limits: FlightLimits) -> float:
    """Of who flies on the outside, with the wind from behind."""
    ground = (airspeed + limits.wind_m_s) * (1.0 + limits.offset_m / radius)
    wide = radius + limits.offset_m
    return math.degrees(math.atan(ground**2 / wide / limits.gravity_m_s2))


@given(LIMITS, st.floats(30.0, 80.0))
def test_the_tightest_turn_takes_the_bank_that_there_is(
    limits: FlightLimits, airspeed: float
) -> None:
    by_lift = math.degrees(math.acos((limits.level_m_s / airspeed) ** 2))
    most = max(min(math.degrees(limits.bank_rad), by_lift) - 5.0, 1.0)
    assert bank_deg(airspeed, tightest_turn(airspeed, limits), limits) == pytest.approx(most)


@given(LIMITS, st.floats(32.0, 58.0))
def test_in_the_tightest_turn_every_slot_has_an_airspeed_that_can_be_flown(
    limits: FlightLimits, airspeed: float
) -> None:
    limits = limits._replace(slowest_m_s=30.0, fastest_m_s=60.0)
    radius = tightest_turn(airspeed, limits)
    for offset in (-limits.offset_m, limits.offset_m):
        for wind in (0.0, limits.wind_m_s):
            at_slot = (airspeed + wind) * (1.0 + offset / radius) - wind
            assert 30.0 - 1e-9 <= at_slot <= 60.0 + 1e-9


def test_at_the_end_of_the_airspeeds_a_turn_remains() -> None:
    limits = FlightLimits(40.0, math.radians(40.0), 25.0, 0.2, 0.0, 20.0, 9.8, 30.0, 60.0)
    assert tightest_turn(30.0, limits) == pytest.approx(600.0)  # the inner one needs 29 m/s


@given(LIMITS, st.floats(50.0, 2000.0))
def test_airspeeds_for_a_radius_are_those_whose_tightest_turn_fits(
    limits: FlightLimits, radius: float
) -> None:
    found = airspeeds_for(radius, limits)
    fits = [v for v in range(1, 200) if v >= limits.level_m_s]
    fits = [v for v in fits if tightest_turn(float(v), limits) <= radius]
    assert found == ((fits[0], fits[-1]) if fits else None)


def test_a_free_turn_has_20_degrees_of_bank_in_still_air() -> None:
    limits = FlightLimits(40.0, math.radians(40.0), 27.0, 0.2, 0.0, 0.0, 9.8)
    assert bank_deg(40.0, turn_radius(40.0, limits), limits) == pytest.approx(20.0)
    shallow = limits._replace(bank_rad=math.radians(15.0))
    assert turn_radius(40.0, shallow) == tightest_turn(40.0, shallow)


def test_level_flight_of_the_paper_s_aircraft(scenario1: Scenario) -> None:
    """Table I: at 40 m/s it flies level with 3.3° and 708 N, at 30 m/s with 11.7°."""
    assert level_airspeed(scenario1.aircraft, math.radians(3.30)) == pytest.approx(40.0, abs=0.1)
    assert level_airspeed(scenario1.aircraft, math.radians(11.7)) == pytest.approx(30.0, abs=0.1)

"""Heading by bank: the loop by itself, and flights of aircraft that need it."""

import math
from typing import Any

import numpy as np
import pytest
from courses import motion_at
from hypothesis import given
from hypothesis import strategies as st
from steps import step_of

from ftc_autopilot.control.diagnosis import HEALTHY, LOST
from ftc_autopilot.control.heading import (
    HeadingLoop,
    along_flight,
    bank_for,
    needs_bank,
    remaining_side_force,
    sideslip_of,
    weathercock_problem,
)
from ftc_autopilot.control.laws.surviving import Surviving
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import ConfigError
from mavlink_defs.constants import ACTUATORS, RUDDER
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

G, OMEGA = 9.8, 2.5
TUBE = {"controller": {"kind": "tube"}, "trigger": {"mode": "consequence"}}
LAW_OF = {"surviving": {"controller": {"kind": "surviving"}}, "tube": TUBE}


# the loop


def poles(k: float) -> np.ndarray:
    """Of the heading, whose rate is k times its error behind the filter of the reference."""
    lagging = np.polymul([1.0, 0.0], np.poly1d([1.0 / OMEGA, 1.0]) ** 3)
    return np.roots(np.polyadd(lagging, [k]))


def test_the_default_gain_is_the_largest_without_overshoot() -> None:
    k = 27.0 / 256.0 * OMEGA
    slow = sorted(poles(k), key=abs)[:2]
    assert np.allclose(slow, -OMEGA / 4.0, rtol=1e-3)
    assert np.abs(np.imag(sorted(poles(0.99 * k), key=abs)[:2])).max() == 0.0
    assert np.abs(np.imag(sorted(poles(1.01 * k), key=abs)[:2])).max() > 0.01


angles = st.floats(-3.1, 3.1)


@given(t=st.floats(0.0, 9.0), yaw=angles, rates=st.tuples(angles, angles), gain=st.floats(0.0, 2.0))
def test_the_bank_is_that_of_a_coordinated_turn(
    t: float, yaw: float, rates: tuple[float, float], gain: float, scenario1: Scenario
) -> None:
    motion = motion_at(t, aircraft_record(scenario1.aircraft))
    filtered = np.zeros((4, 3))
    filtered[3] = yaw, *rates
    k = gain or 27.0 / 256.0 * OMEGA
    course = motion.phi[2] + math.asin(motion.v[1] / motion.V)
    away = (yaw - course + math.pi) % (2.0 * math.pi) - math.pi
    expected = math.atan(motion.V / G * (rates[0] + 3.0 / OMEGA * rates[1] + k * away))
    found = bank_for(motion, filtered, OMEGA, HeadingLoop(True, gain, 0.6), G)
    assert found == pytest.approx(min(max(expected, -0.6), 0.6), abs=1e-9)


@given(t=st.floats(0.0, 9.0))
def test_the_law_is_to_follow_the_direction_of_flight(t: float, scenario1: Scenario) -> None:
    motion = motion_at(t, aircraft_record(scenario1.aircraft))
    before = step_of(motion)
    now = along_flight(before, G)
    beta = math.asin(motion.v[1] / motion.V)
    assert sideslip_of(motion) == pytest.approx(beta)
    assert now.by_bank
    assert now.errors.e[2] == now.errors.e_prime[2] / now.errors.lambda_omega == -beta
    assert now.reference.phi[2] == motion.phi[2] + beta
    assert now.reference.phi_dot[2] == pytest.approx(G * math.tan(motion.phi[0]) / motion.v[0])
    assert now.errors.e[:2] == before.errors.e[:2]
    assert now.reference.phi[:2] == before.reference.phi[:2]


# who needs it


def changed(name: str, **values: Any) -> Aircraft:
    return Aircraft.model_validate(merged(load_aircraft(name).model_dump(), values))


def test_what_an_aircraft_needs_follows_from_its_structure() -> None:
    assert needs_bank(load_aircraft("paper")) is None
    assert needs_bank(load_aircraft("aerosonde")) is None
    assert needs_bank(load_aircraft("skywalker_x8")) == "no rudder"
    slipping = changed("aerosonde", coefficients={"cY_dr": 1.2})
    assert needs_bank(slipping) == "sideslip grows while the rudder holds the heading"
    c, qS = slipping.coefficients, 0.5 * 1.2682 * 24.0**2 * 0.55
    expected = qS * (c.cY_beta - c.cD0 - c.cY_dr * c.cn_beta / c.cn_dr)
    assert remaining_side_force(slipping, 24.0) == pytest.approx(expected)
    assert needs_bank(changed("aerosonde", coefficients={"cn_dr": 0.0})) is not None
    for heading, reason in (("rudder", None), ("bank", "chosen"), ("auto", needs_bank(slipping))):
        law = Surviving.model_validate({"heading": heading})
        assert law.holds_heading_by_bank(slipping) == reason


def test_without_a_rudder_the_nose_must_turn_into_the_wind_by_itself() -> None:
    assert weathercock_problem(load_aircraft("skywalker_x8")) is None
    unstable = changed("skywalker_x8", coefficients={"cn_beta": -0.01})
    problem = weathercock_problem(unstable)
    assert problem is not None
    assert next(iter(Surviving().misfits(unstable))) == problem
    assert weathercock_problem(changed("aerosonde", coefficients={"cn_beta": -0.1})) is None


# flights


def scenario(name: str, *changes: dict[str, Any]) -> Scenario:
    tree = scenario_tree(name)
    for change in changes:
        tree = merged(tree, change)
    return scenario_of(name, tree)


def sideslip_deg(flight: Recording) -> np.ndarray:
    v = flight.states[..., 3:6]  # the air is still
    found: np.ndarray = np.degrees(np.arcsin(v[..., 1] / np.linalg.norm(v, axis=-1)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("law", LAW_OF)
def test_a_flying_wing_turns_by_bank(law: str) -> None:
    """Events and errors besides; the rudder that is not there neither moves nor fails."""
    flight = fly_in_process(scenario("airframes/skywalker_x8", LAW_OF[law]))
    assert flight.loss is None
    signals = flight.signals
    assert not (signals["events"] >> RUDDER & 1).any()
    assert not signals["held"][..., RUDDER].any()
    assert (signals["phase"][..., RUDDER] == HEALTHY).all()
    assert (signals["effectiveness"][..., RUDDER] == 1.0).all()
    assert not signals["offset"][..., RUDDER].any()
    assert (signals["phase"] != LOST).all()  # half an aileron is none that is lost
    errors = np.degrees(np.abs(flight.error("reference")[1000:, :, 1:]))
    assert np.all(errors.max(axis=(0, 1))[:2] < (4.0, 2.5))  # roll, pitch
    yaw = np.degrees(signals["attitude"][..., 2])
    for begin_s in (11.0, 20.0):  # 7 s after it was commanded, about which it swings, undamped
        mean = yaw[round(begin_s * 1000) : round(begin_s * 1000) + 4000].mean(axis=0)
        assert np.all(np.abs(mean - 8.0) < 2.0)
    assert np.count_nonzero(signals["events"]) / 3 < {"surviving": 250, "tube": 160}[law]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAW_OF)
def test_bank_keeps_the_sideslip_of_an_aircraft_that_slips_under_rudder(law: str) -> None:
    slips = {"aircraft": {"coefficients": {"cY_dr": 1.2}}}
    kept = fly_in_process(scenario("airframes/aerosonde", slips, LAW_OF[law]))
    assert np.abs(sideslip_deg(kept)).max() < 2.0
    errors = np.degrees(np.abs(kept.error("reference")[1000:, :, 1:]))
    assert np.all(errors.max(axis=(0, 1)) < (3.0, 1.0, 2.5))
    by_rudder = merged(LAW_OF[law], {"controller": {"heading": "rudder"}})
    lost = fly_in_process(scenario("airframes/aerosonde", slips, by_rudder))
    assert np.abs(sideslip_deg(lost)).max() > 20.0


@pytest.mark.slow
@pytest.mark.parametrize("law", LAW_OF)
@pytest.mark.parametrize("actuator", ["aileron", "elevator"])
def test_a_flying_wing_that_loses_an_actuator_says_so(law: str, actuator: Any) -> None:
    """What is left of it may be nothing, but the law goes on."""
    fault = {"uav": 3, "actuator": actuator, "stuck_deg": 2.0, "start_s": 5.0}
    changes = {"faults": [fault], "duration_s": 8.0}
    flight = fly_in_process(scenario("airframes/skywalker_x8", LAW_OF[law], changes))
    phases = flight.signals["phase"][:, 2]
    assert (phases[:, ACTUATORS.index(actuator)] == LOST).any()
    assert (phases[:, RUDDER] == HEALTHY).all()
    assert not (flight.signals["events"] >> RUDDER & 1).any()


# refused before a flight


@pytest.mark.parametrize(
    ("change", "said"),
    [
        *(
            (
                {"controller": {"kind": kind}},
                "controller.kind: expected one of surviving, tube, as the aircraft has no rudder "
                f"to hold the heading; got '{kind}'",
            )
            for kind in ("proposed", "backstepping", "pid")
        ),
        (
            {"controller": {"heading": "rudder"}},
            "controller.heading: expected 'auto' or 'bank', as the aircraft has no rudder, got",
        ),
        (
            {"faults": [{"uav": 2, "actuator": "rudder", "effectiveness": 0.5, "start_s": 1.0}]},
            "faults[0].actuator: the aircraft has no rudder",
        ),
        (
            {"aircraft": {"surface_limits_deg": {"elevator": "none"}}},
            "no moment can be made by its elevator",
        ),
    ],
)
def test_what_a_flying_wing_cannot_do_is_told(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=r".") as caught:
        scenario("airframes/skywalker_x8", change)
    assert said in str(caught.value)

"""The table of airframes: what is flown, and that healthy actuators are not blamed."""

import numpy as np
import pytest

from benchmarks.airframes import (
    AIRFRAMES,
    DIAGNOSING,
    Case,
    designed,
    faults_of,
    fly,
    is_designed,
    tables,
)
from benchmarks.least_roll import lateral_model, least_roll
from ftc_lab.identification.trim import acceleration, motion_at
from gcs.results.rivals import flight_of
from gcs.results.runs.details import leaves
from gcs.scenario.settings import plain
from sitl_plant.airframe.level_flight import level_flight
from sitl_plant.simulators.own import OwnSimulator


@pytest.mark.parametrize("law", DIAGNOSING)
@pytest.mark.parametrize("airframe", AIRFRAMES)
def test_every_airframe_has_a_design_of_each_law(airframe: str, law: str) -> None:
    scenario = designed(airframe, law)
    assert scenario.controller.kind == law
    assert len(scenario.uavs) == 1
    assert scenario.sensors.gyro_deg_s.noise_rms == 0.3
    surfaces = scenario.servos.surfaces
    assert (surfaces.lag_s, surfaces.rate_limit_deg_s) == (0.02, 400.0)


@pytest.mark.parametrize("law", ["pid", "backstepping", "proposed"])
def test_rivals_fly_the_same_scenario_by_a_design_of_their_own(law: str) -> None:
    base, rival = designed("c172p", "surviving"), designed("c172p", law)
    assert rival.controller.kind == law
    keys = (dict(leaves(plain(one.model_dump()), "")) for one in (base, rival))
    assert len({flight_of(each) for each in keys}) == 1
    assert not is_designed("skywalker_x8", law)
    assert is_designed("minisgs", law)


def test_a_law_that_cannot_fly_an_airframe_is_said_to_be_refused() -> None:
    flown = fly(Case("skywalker_x8", "tube", "none"))
    errors, *_ = tables({("skywalker_x8", "none"): {"pid": [], "tube": [flown]}}, "fault")
    assert "| skywalker_x8 | none | refused | 2." in errors
    assert "**" not in errors


def test_faults_are_on_the_time_scale_and_within_the_stops_of_the_aircraft() -> None:
    faults = faults_of(designed("c172p", "tube"))
    (stuck,) = faults["aileron stuck at 3/35 of its stop"]
    assert stuck == {"uav": 1, "actuator": "aileron", "stuck_deg": 1.71, "start_s": 25.0}
    (weak,) = faults["rudder at 90 %"]
    assert (weak["start_s"], weak["end_s"]) == (47.5, 55.0)
    assert "elevator at 50 %" in faults_of(designed("skywalker_x8", "tube"))


@pytest.mark.parametrize("law", DIAGNOSING)
def test_a_stuck_aileron_is_announced_in_time_and_nothing_else_is(law: str) -> None:
    flown = fly(Case("aerosonde", law, "aileron stuck at 3°"))
    assert flown.loss is None
    found_s = flown.uav.first_delay_s("lost")
    assert found_s is not None
    assert found_s <= 0.25
    roll = flown.uav.max_error["roll"]
    assert roll is not None
    assert roll <= 10.0
    assert flown.uav.false_alarms == 0
    *_, announced = tables({("aerosonde", "stuck"): {law: [flown]}}, "fault")
    assert f"| {1e3 * found_s:.0f}, 0 |" in announced


def test_other_noise_flies_another_flight() -> None:
    first, again, other = (
        fly(Case("skywalker_x8", "tube", "none", seed)).uav for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_the_least_roll_grows_with_the_fault_and_with_the_time_until_the_rudder_moves() -> None:
    aerosonde = designed("aerosonde", "surviving")
    least = [
        np.degrees(least_roll(aerosonde, np.radians(stuck), after))
        for stuck, after in ((1.0, 0.0), (3.0, 0.0), (3.0, 0.1), (3.0, 0.2))
    ]
    assert least == sorted(least)
    assert least[-1] < 10.0


def test_the_linear_motion_is_the_plants() -> None:
    """Its derivatives are those of our own equations about level flight, as 5 ms show them."""
    scenario = designed("aerosonde", "surviving")
    aircraft = scenario.aircraft_of(1)
    flight = level_flight(aircraft, 28.0)
    assert flight is not None
    model = lateral_model(aircraft, 28.0)
    simulator = OwnSimulator(aircraft)
    delta = tuple(map(np.radians, (flight.aileron_deg, flight.elevator_deg, flight.rudder_deg)))
    alpha = np.radians(flight.alpha_deg)

    def turning(aileron: float, rudder: float) -> np.ndarray:
        moved = delta[0] + aileron, delta[1], delta[2] + rudder
        return np.array(acceleration(simulator, motion_at(28.0, alpha), moved, flight.thrust_n)[1])

    for column, (aileron, rudder) in ((4, (0.01, 0.0)), (5, (0.0, 0.01))):
        p_dot, _, r_dot = (turning(aileron, rudder) - turning(0.0, 0.0)) / 0.01
        expected = model[1:3, column]
        assert (p_dot, r_dot) == pytest.approx(expected, abs=0.15 * np.abs(expected).max())

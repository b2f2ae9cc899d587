"""The table of airframes: what is flown, and that healthy actuators are not blamed."""

import pytest

from benchmarks.airframes import AIRFRAMES, LAWS, Case, designed, faults_of, fly, line


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("airframe", AIRFRAMES)
def test_every_airframe_has_a_design_of_each_law(airframe: str, law: str) -> None:
    scenario = designed(airframe, law)
    assert scenario.controller.kind == law
    assert len(scenario.uavs) == 1
    assert scenario.sensors.gyro_deg_s.noise_rms == 0.3
    surfaces = scenario.servos.surfaces
    assert (surfaces.lag_s, surfaces.rate_limit_deg_s) == (0.02, 400.0)


def test_faults_are_on_the_time_scale_and_within_the_stops_of_the_aircraft() -> None:
    faults = faults_of(designed("c172p", "tube"))
    (stuck,) = faults["aileron stuck at 3/35 of its stop"]
    assert stuck == {"uav": 1, "actuator": "aileron", "stuck_deg": 1.71, "start_s": 25.0}
    (weak,) = faults["rudder at 90 %"]
    assert (weak["start_s"], weak["end_s"]) == (47.5, 55.0)
    assert "elevator at 50 %" in faults_of(designed("skywalker_x8", "tube"))


@pytest.mark.parametrize("law", LAWS)
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
    assert f"| {1e3 * found_s:.0f} | 0 |" in line(flown)


def test_other_noise_flies_another_flight() -> None:
    first, again, other = (
        fly(Case("skywalker_x8", "tube", "none", seed)).uav for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other

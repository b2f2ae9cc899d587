"""Wind: what blows where and when, and what an aircraft in it notices."""

import math
from typing import Any

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.framing.codec import MessageId, new_buffer, pack
from sitl_plant.air.config import Gust, Shear, SteadyWind, Wind
from sitl_plant.air.wind import new_wind, wind_at
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.loop.fleet import fly, new_plant_state, observe
from sitl_plant.loop.period import describe_loss, is_lost
from sitl_plant.vec3 import vec3

BREEZE = {"steady": {"north_m_s": 10.0, "east_m_s": -5.0, "down_m_s": 1.0}}


def flown(scenario1: Scenario, wind: dict[str, Any], **more: Any) -> Recording:
    tree = scenario1.model_dump() | {"duration_s": 3.0, "wind": wind} | more
    return fly_in_process(scenario_of("wind", tree))


def test_parts_add_up() -> None:
    config = Wind(
        steady=SteadyWind(north_m_s=1.0, east_m_s=2.0, down_m_s=3.0),
        shear=Shear(north_1_s=0.1, east_1_s=-0.2, altitude_m=100.0),
        gust=Gust(start_s=5.0, duration_s=2.0, north_m_s=8.0, down_m_s=-4.0),
    )
    wind = new_wind(config)[0]
    at_100, at_150 = (0.0, 0.0, -100.0), (50.0, 70.0, -150.0)
    assert wind_at(wind, at_100, 5.0) == (1.0, 2.0, 3.0)
    assert wind_at(wind, at_150, 4.0) == pytest.approx((6.0, -8.0, 3.0))
    assert wind_at(wind, at_100, 6.0) == pytest.approx((9.0, 2.0, -1.0))  # the peak
    quarter = 0.5 * (1.0 - math.cos(math.pi / 2.0))
    assert wind_at(wind, at_100, 5.5) == pytest.approx((1.0 + 8.0 * quarter, 2.0, 3.0 - 2.0))
    assert wind_at(wind, at_100, 7.0) == pytest.approx((1.0, 2.0, 3.0))


def test_steady_wind_carries_the_same_flight_along(scenario1: Scenario) -> None:
    """Galileo: through air that moves as a whole an aircraft flies as through calm air."""
    periodic = {"trigger": {**scenario1.trigger.model_dump(), "mode": "periodic"}}
    calm, windy = flown(scenario1, {}, **periodic), flown(scenario1, BREEZE, **periodic)
    assert windy.loss is None
    through = windy.states[..., 3:6] - windy.wind
    assert through == pytest.approx(calm.states[..., 3:6], abs=1e-6)
    assert windy.states[..., 6:] == pytest.approx(calm.states[..., 6:], abs=1e-6)
    assert windy.response == pytest.approx(calm.response, abs=1e-6)
    assert windy.signals["V"] == pytest.approx(calm.signals["V"], abs=1e-6)
    assert windy.signals["V_dot"] == pytest.approx(calm.signals["V_dot"], abs=1e-5)
    drift = windy.states[..., :3] - calm.states[..., :3]
    carried = calm.time_s[:, None, None] * np.ones((1, 3, 1)) * [10.0, -5.0, 1.0]
    assert drift == pytest.approx(carried, abs=1e-6)


def test_forces_follow_from_the_motion_through_the_air(scenario1: Scenario) -> None:
    """Of an aircraft without commands that has just met the wind; (2) and (7) by hand."""
    tree = scenario1.model_dump() | {"disturbance": {}, "wind": BREEZE}
    config = scenario_of("wind", tree).plant_config()
    fleet = new_plant_state(config)
    fleet.uavs[0]["state"][3:6] = (40.0, 1.0, 2.0)  # over ground, not through the air
    before = fleet.uavs[0]["state"].copy()
    fly(fleet, 0, 10)
    change = (fleet.uavs[0]["state"][3:6] - before[3:6]) / 1e-5
    aircraft = config.uavs[0].aircraft
    R = np.array(R1(vec3(before[6:9])))
    u, v, w = before[3:6] - R.T @ [10.0, -5.0, 1.0]
    V, alpha = math.sqrt(u * u + v * v + w * w), math.atan2(w, u)
    beta, c = math.asin(v / V), aircraft.coefficients
    qS = 0.5 * aircraft.air_density_kg_m3 * V * V * aircraft.wing_area_m2
    drag, side = qS * c.cD0, qS * c.cY_beta * beta
    lift = qS * (c.cL0 + c.cL_alpha * alpha)
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    force = np.array(
        [
            -drag * ca * cb - side * ca * sb + lift * sa,
            -drag * sb + side * cb,
            -drag * sa * cb - side * sa * sb - lift * ca,
        ]
    )
    expected = force / aircraft.mass_kg + R.T @ [0.0, 0.0, aircraft.gravity_m_s2]
    assert change == pytest.approx(expected, abs=0.01)


def test_the_initial_airspeed_is_one_through_the_air(scenario1: Scenario) -> None:
    for wind in ({}, BREEZE, {"turbulence": "severe"}):
        tree = scenario1.model_dump() | {"wind": wind}
        fleet = new_plant_state(scenario_of("wind", tree).plant_config())
        through = fleet.uavs["state"][:, 3:6] - fleet.uavs["air"][:, :3]
        assert through == pytest.approx(np.array([[40.0, 0, 0], [40.5, 0, 0], [40.0, 0, 0]]))


def test_loss_goes_by_the_airspeed() -> None:
    x, calm = np.zeros(12), np.zeros(3)
    x[3] = 4.0
    assert not is_lost(x, calm)
    assert is_lost(x, np.array([2.0, 0.0, 0.0]))
    assert not is_lost(x, np.array([-2.0, 0.0, 0.0]))
    assert "airspeed 2.0 m/s" in describe_loss(x, np.array([2.0, 0.0, 0.0]))


def test_a_state_message_without_wind_has_the_bytes_that_it_always_had(scenario1: Scenario) -> None:
    """The wind is the message's last field, and zeros at the end are not sent."""
    fleet = new_plant_state(scenario1.plant_config())
    fleet.uavs["message"]["run"] = 0x01020304
    observe(fleet, 0, 7, 1000)
    buffer = new_buffer()
    length = pack(buffer, fleet.uavs["message"][:1], MessageId.SIM_STATE, 1, 158, 0)
    assert length == 10 + 141 + 4 + 2  # header, fields, `run`, checksum
    fleet.uavs["message"]["wind"][0] = 1.0
    assert pack(buffer, fleet.uavs["message"][:1], MessageId.SIM_STATE, 1, 158, 0) == length + 24


def test_turbulence_is_each_aircrafts_own_and_the_same_in_every_flight(scenario1: Scenario) -> None:
    air = {"turbulence": "moderate"}
    first, again = flown(scenario1, air), flown(scenario1, air)
    assert np.array_equal(first.states, again.states)
    assert np.array_equal(first.signals["V"], again.signals["V"])
    series = first.wind[:, :, 2].T
    assert np.all(series.std(axis=1) > 0.1)
    assert np.abs(np.corrcoef(series)[np.triu_indices(3, 1)]).max() < 0.95
    other = flown(scenario1, air, seed=2)
    assert not np.isclose(other.wind[0], first.wind[0]).any()

"""The Cessna of JSBSim on JSBSim's ground."""

import numpy as np
import pytest
from ground_flights import AT_REST, aircraft_with

from sitl_plant.airframe.standing import contact_facts
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.fleet import ADVANCE, PlantState, fly, new_plant_state, observe
from sitl_plant.loop.simulators import Outside
from sitl_plant.simulators.config import JsbSimPlant

pytest.importorskip("jsbsim")

STEP_US = 4000


def standing(**initial: float) -> tuple[PlantState, Outside]:
    aircraft = aircraft_with("c172p")
    begins = InitialState.model_validate(initial or {**AT_REST, "yaw_deg": 20.0})
    plant = JsbSimPlant(kind="jsbsim", aircraft="c172p")
    uav = PlantUav(id=1, initial=begins, aircraft=aircraft, plant=plant)
    config = PlantConfig(bind="127.0.0.1:1", uavs=(uav,), step_us=STEP_US)
    fleet = new_plant_state(config)
    return fleet, Outside(config, fleet)


def flown(fleet: PlantState, outside: Outside, seconds: float) -> np.ndarray:
    states = []
    for k in range(round(seconds * 1e6 / STEP_US)):
        observe(fleet, 0, k, STEP_US)
        fleet.uavs[0]["message"]["actuator_time_usec"] = 0
        lost = fly(fleet, k, STEP_US)
        if lost == ADVANCE:
            outside.advance()
            lost = fly(fleet, k, STEP_US)
        states.append(fleet.uavs[0]["state"].copy())
        if lost >= 0:
            break
    return np.array(states)


def test_it_stands_brakes_and_steers() -> None:
    fleet, outside = standing()
    uav = fleet.uavs[0]
    before = uav["state"].copy()
    assert np.linalg.norm(uav["outside"]["specific_force"]) == pytest.approx(9.81, rel=2e-3)
    assert uav["gear"]["load"] == pytest.approx(1.0, abs=0.01)
    states = flown(fleet, outside, 5.0)
    assert np.abs(states - before)[:, :9].max() < 1e-3
    uav["controls"][2], uav["controls"][3] = 0.2, 2500.0
    rolled = flown(fleet, outside, 4.0)
    assert rolled[-1, 3] > 3.0
    assert rolled[-1, 8] - before[8] < -0.2  # a positive rudder turns to the left
    uav["controls"][2:], uav["gear"]["brake"] = 0.0, 1.0
    braked = flown(fleet, outside, 6.0)
    assert np.abs(braked[-1, 3:6]).max() < 0.01
    found = contact_facts(uav["gear"])
    assert found is not None
    assert found["outcome"] == "on the ground"


def test_it_lands_or_crashes() -> None:
    for altitude, pitch, outcome in ((2.0, 2.0, "landed"), (4.0, -6.0, "crashed")):
        fleet, outside = standing(
            north_m=0.0, east_m=0.0, altitude_m=altitude, airspeed_m_s=36.0, pitch_deg=pitch
        )
        fleet.uavs[0]["gear"]["flew"] = 1
        flown(fleet, outside, 6.0)
        found = contact_facts(fleet.uavs[0]["gear"])
        assert found is not None
        assert found["worst"]["sink_m_s"] > 0.1
        assert found["outcome"].startswith(outcome), found

"""Our own equations as a simulator: the plant's flight again, and what wind does to it."""

import math

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import load_scenario
from sitl_plant.air.config import Disturbance
from sitl_plant.simulators.base import Motion
from sitl_plant.simulators.own import OwnSimulator
from sitl_plant.vec3 import vec3

REST = (0.0, 0.0, 0.0)


def test_it_flies_as_the_plant_does() -> None:
    """Given the deflections of a flight, the same motion, step by step."""
    scenario = load_scenario("airframes/aerosonde")
    scenario = scenario.model_copy(update={"disturbance": Disturbance(), "duration_s": 6.0})
    recording = fly_in_process(scenario)
    simulator = OwnSimulator(scenario.aircraft)
    p, v, phi, omega = (vec3(part) for part in recording.states[0, 0].reshape(4, 3))
    simulator.reset(Motion(p, v, phi, omega, REST))
    for k in range(len(recording.states) - 1):
        aileron, elevator, rudder, thrust = map(float, recording.applied[k, 0])
        simulator.control((aileron, elevator, rudder), thrust)
        simulator.advance(1e-3)
        if k % 500 == 0:
            found = np.concatenate(simulator.read()[:4])
            assert found == pytest.approx(recording.states[k + 1, 0], rel=1e-9, abs=1e-9)


def test_what_is_felt_is_the_motion_less_gravity() -> None:
    """v̇ + ω × v - g, from two readings; in a wind, too."""
    aircraft = load_scenario("airframes/aerosonde").aircraft
    simulator = OwnSimulator(aircraft)
    simulator.set_wind((3.0, -4.0, 1.0))
    simulator.control((0.05, -0.1, 0.02), 20.0)
    simulator.reset(Motion(REST, (24.0, 1.0, 2.0), (0.3, 0.1, 1.0), (0.2, -0.1, 0.3), REST))
    before = simulator.read()
    simulator.advance(1e-3)
    after = simulator.read()
    v = (np.array(before.velocity) + np.array(after.velocity)) / 2.0
    omega = (np.array(before.rates) + np.array(after.rates)) / 2.0
    roll, pitch = (np.add(before.attitude, after.attitude) / 2.0)[:2]
    g = aircraft.gravity_m_s2
    down = np.array(
        [-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)]
    )
    slope = (np.array(after.velocity) - np.array(before.velocity)) / 1e-3
    felt = (np.array(before.specific_force) + np.array(after.specific_force)) / 2.0
    assert slope + np.cross(omega, v) - g * down == pytest.approx(felt, abs=1e-3)


def test_only_the_motion_through_the_air_counts() -> None:
    """Carried by a wind along its course, it feels what it feels in still air."""
    aircraft = load_scenario("airframes/aerosonde").aircraft
    felt = []
    for wind in (0.0, 6.0):
        simulator = OwnSimulator(aircraft)
        simulator.set_wind((wind, 0.0, 0.0))
        simulator.reset(Motion(REST, (24.0 + wind, 0.0, 0.0), REST, REST, REST))
        felt.append(simulator.read().specific_force)
    assert felt[0] == pytest.approx(felt[1])

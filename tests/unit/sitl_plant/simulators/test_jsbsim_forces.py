"""Our aerodynamic model and JSBSim's, of one aircraft: each checks the other."""

import math
from pathlib import Path

import numpy as np
import pytest
from jsbsim_aircraft import needs_jsbsim, write_aircraft

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.airframe.aerodynamics import aerodynamics, moment
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import specific_force
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.fleet import ADVANCE, fly, new_plant_state
from sitl_plant.loop.simulators import Outside
from sitl_plant.simulators import new_simulator
from sitl_plant.simulators.base import Motion, Simulator
from sitl_plant.simulators.config import JsbSimPlant, OwnPlant, PlantSection
from sitl_plant.vec3 import Vec3

pytestmark = needs_jsbsim

ALTITUDE_M = 300.0
EARTH_RATE = 7.292115e-5  # rad/s, WGS84
STEP = 1e-3

EVERY_TERM = {
    "cD_alpha2": 1.1, "cD_beta": 0.02, "cD_beta2": 0.4, "cD_de2": 0.3, "cY0": 0.01,
    "cY_p": -0.05, "cY_r": 0.2, "cl0": 0.002, "cn0": -0.001,
}  # fmt: skip
"""Beside the Aerosonde's own, so that none is 0."""


def aerosonde(**coefficients: float) -> Aircraft:
    tree = load_aircraft("aerosonde").model_dump()
    tree["coefficients"] |= coefficients
    return Aircraft.model_validate(tree)


@pytest.fixture
def full(tmp_path: Path) -> tuple[Aircraft, Simulator]:
    aircraft = aerosonde(**EVERY_TERM)
    assert all(value != 0.0 for value in aircraft.coefficients.model_dump().values())
    folder = write_aircraft(tmp_path, aircraft)
    plant = JsbSimPlant(kind="jsbsim", aircraft=str(folder))
    return aircraft, new_simulator(plant, ALTITUDE_M)


def test_mass_inertia_and_lengths_are_the_same(full: tuple[Aircraft, Simulator]) -> None:
    aircraft, simulator = full
    body = simulator.body
    assert body.inertia_kg_m2.model_dump() == pytest.approx(aircraft.inertia_kg_m2.model_dump())
    for name in body._fields:
        if name != "inertia_kg_m2":
            assert getattr(body, name) == pytest.approx(getattr(aircraft, name), rel=1e-5), name
    assert simulator.stops == pytest.approx(np.array([[-0.5, 0.5]] * 3))


def test_forces_and_moments_over_the_envelope(full: tuple[Aircraft, Simulator]) -> None:
    aircraft, simulator = full
    record, random = aircraft_record(aircraft), np.random.default_rng(1)
    J = record["J"]
    for _ in range(200):
        V, alpha = random.uniform(15.0, 40.0), math.radians(random.uniform(-35.0, 40.0))
        beta = math.radians(random.uniform(-15.0, 15.0))
        omega = random.uniform(-1.5, 1.5, 3)
        delta: Vec3 = tuple(random.uniform(-0.45, 0.45, 3).tolist())
        thrust = random.uniform(0.0, 40.0)
        v: Vec3 = (
            V * math.cos(alpha) * math.cos(beta),
            V * math.sin(beta),
            V * math.sin(alpha) * math.cos(beta),
        )
        attitude: Vec3 = tuple(random.uniform(-0.5, 0.5, 3).tolist())
        simulator.control(delta, thrust)
        still: Vec3 = (0.0, 0.0, 0.0)
        rates: Vec3 = tuple(omega.tolist())
        simulator.reset(Motion((0.0, 0.0, -ALTITUDE_M), v, attitude, rates, still))
        air = aerodynamics(v, rates, record)
        ours = np.array(specific_force(air, delta, thrust, record))
        theirs = np.array(simulator.read().specific_force)
        assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-6 * float(np.linalg.norm(ours)))
        simulator.advance(STEP)  # its rates by Euler's rule: the moment before
        turned = (np.array(simulator.read().rates) - omega) / STEP
        made = J @ turned + np.cross(omega, J @ omega)
        turning = np.array(moment(air, delta))
        of_earth = float(3.0 * EARTH_RATE * np.linalg.norm(omega) * np.linalg.norm(J))
        assert made == pytest.approx(turning, rel=1e-5, abs=of_earth)


def gravity(latitude_deg: float, altitude_m: float) -> float:
    """Normal gravity of WGS84 [m/s²] (NIMA TR8350.2, 4-1 and 4-3, to first order)."""
    s = math.sin(math.radians(latitude_deg)) ** 2
    at_sea = 9.7803253359 * (1.0 + 0.00193185265241 * s) / math.sqrt(1.0 - 0.00669437999013 * s)
    return at_sea - 3.086e-6 * altitude_m


def flown(plant: PlantSection, aircraft: Aircraft, seconds: float) -> np.ndarray:
    """Fly doublets of all surfaces and steps of the thrust; return all states."""
    initial = InitialState(
        north_m=0.0, east_m=0.0, altitude_m=ALTITUDE_M, airspeed_m_s=25.0, pitch_deg=2.0
    )
    uav = PlantUav(id=1, initial=initial, aircraft=aircraft, plant=plant)
    config = PlantConfig(bind="127.0.0.1:1", uavs=(uav,), duration_s=seconds)
    fleet = new_plant_state(config)
    outside = Outside(config, fleet)
    states = np.empty((round(seconds * 1000), 12))
    for k in range(len(states)):
        states[k] = fleet.uavs[0]["state"]
        t = k * 1e-3
        square = [
            math.copysign(1.0, math.sin(2.0 * math.pi * t / period)) for period in (1.0, 1.5, 2)
        ]
        trim = (0.0, -0.035, 0.0)
        for axis in range(3):
            fleet.uavs[0]["controls"][axis] = trim[axis] + 0.02 * square[axis]
        fleet.uavs[0]["controls"][3] = 10.0 + 5.0 * square[2]
        fleet.uavs[0]["message"]["actuator_time_usec"] = k
        lost = fly(fleet, k, 1000)
        if lost == ADVANCE:
            outside.advance()
            lost = fly(fleet, k, 1000)
        assert lost == -1, states[k]
    return states


def test_ten_seconds_of_doublets_are_the_same_flight(tmp_path: Path) -> None:
    changed = aerosonde(**EVERY_TERM).model_dump()
    changed["gravity_m_s2"] = gravity(45.0, ALTITUDE_M)
    aircraft = Aircraft.model_validate(changed)
    folder = write_aircraft(tmp_path, aircraft)
    plant = JsbSimPlant(kind="jsbsim", aircraft=str(folder), step_us=100)
    ours, theirs = flown(OwnPlant(), aircraft, 10.0), flown(plant, aircraft, 10.0)
    moved = np.abs(ours - ours[0]).max(axis=0)
    assert (moved[[0, 1, 2]] > (150.0, 3.0, 3.0)).all(), moved
    assert (moved[6:9] > math.radians(3.0)).all(), moved
    apart = np.abs(theirs - ours).max(axis=0)
    coriolis = 2.0 * EARTH_RATE * 30.0  # m/s²: the Earth of JSBSim turns
    assert (apart[0:3] < 0.5 * coriolis * 10.0**2 + 0.02).all(), apart
    assert (apart[3:6] < 0.003).all(), apart
    assert (apart[6:9] < math.radians(0.2)).all(), apart
    assert (apart[9:12] < math.radians(0.1)).all(), apart

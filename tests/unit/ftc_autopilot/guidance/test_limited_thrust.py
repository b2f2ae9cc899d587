"""Guidance climbs and speeds up as far as the propulsion permits at the present airspeed."""

import math

import numpy as np
import pytest
from steps import on_path, situation_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.guidance.aircraft_limits import HOME
from ftc_autopilot.guidance.laws import GUIDANCE_STATE, guidance_record, guide
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.path import path_record
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.aerodynamics import drag
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import vec3

DT, MAX_CLIMB = 0.02, math.radians(8.5)
WIDE = HOME._replace(acceleration_max_m_s2=30.0, climb_max_deg=45.0, airspeed_max_m_s=80.0)
GUIDANCE = PathFollowing(**WIDE._asdict())


def commands(aircraft: np.void, V: float, updates: int, wanted_m_s: float) -> np.ndarray:
    """Commands while the aircraft stays as it is, far below a path that is to be flown faster."""
    path = path_record([Leg(0.0, 0.0, 0.0, 0.0, math.inf, 5000.0, 0.0, wanted_m_s, 1)], 1)
    measured = np.zeros(1, SIM_STATE)[0]
    measured["position"], measured["velocity"] = (0.0, 0.0, -100.0), (V, 0.0, 0.05 * V)
    measured["attitude"] = 0.0, 0.05, 0.0
    motion = motion_of(measured, aircraft)
    ground = vec3(np.array(R1(motion.phi)) @ np.array(motion.v))
    now = on_path(situation_of(motion, (0.0, 0.0, -100.0), ground, ground, DT), path, 0.0)
    parameters, state = guidance_record(GUIDANCE), np.zeros(1, GUIDANCE_STATE)[0]
    return np.array([guide(now, path, aircraft, parameters, state) for _ in range(updates)])


def spare(aircraft: np.void, V: float) -> float:
    """0.9 of the thrust that there is, less the drag [N]."""
    airspeed = V * math.hypot(1.0, 0.05)
    qS = 0.5 * aircraft["rho"] * airspeed**2 * aircraft["S"]
    return float(0.9 * available_thrust(airspeed, aircraft) - drag(qS, math.atan(0.05), aircraft))


@pytest.mark.parametrize("V", [43.0, 46.0])
def test_the_airspeed_rises_by_the_thrust_to_spare(propelled: np.void, V: float) -> None:
    rate = np.diff(commands(propelled, V, 20, 60.0)[1:, 0]) / DT
    assert 2.0 < spare(propelled, V) / propelled["m"] < 30.0
    assert rate == pytest.approx(spare(propelled, V) / propelled["m"])
    assert commands(propelled, V, 20, 20.0)[-1, 0] < V - 5.0  # slower as ever
    free = propelled.copy()
    free["thrust_rows"] = 0
    assert np.diff(commands(free, V, 20, 60.0)[1:, 0]) / DT == pytest.approx(30.0)


def test_without_thrust_to_spare_it_does_not_rise(propelled: np.void) -> None:
    V = 65.0
    assert spare(propelled, V) < 0.0
    airspeeds = commands(propelled, V, 20, 75.0)[:, 0]
    assert airspeeds == pytest.approx(V * math.hypot(1.0, 0.05))


@pytest.mark.parametrize("V", [46.0, 47.0])
def test_a_climb_takes_the_thrust_to_spare(propelled: np.void, V: float) -> None:
    """At the airspeed of the path, far below it; sin γ = (0.9 T_max - D)/(m g)."""
    airspeed = V * math.hypot(1.0, 0.05)
    weight = propelled["m"] * propelled["g"]
    climb = math.asin(spare(propelled, V) / weight)
    assert 0.01 < climb < math.radians(45.0)
    pitch = commands(propelled, V, 2, airspeed)[-1, 2]
    lift = 0.5 * propelled["rho"] * airspeed**2 * propelled["S"]
    at_zero, slope = 0.1, 0.25 + 0.5  # C_L and, with the part of the thrust, its slope
    alpha = (weight * math.cos(climb) / lift - at_zero) / slope
    feedback = min(max(climb - (0.05 - math.atan(0.05)), -MAX_CLIMB), MAX_CLIMB)  # flown level
    assert pitch == pytest.approx(climb + alpha + feedback, abs=0.02)

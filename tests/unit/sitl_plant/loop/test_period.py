"""One aircraft over one period, what it measures there, and where its model ends."""

import math
from typing import Any

import numpy as np
import pytest
from plain_faults import actuator_fault, add_fault
from scipy.integrate import solve_ivp

from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, THROTTLE
from mavlink_defs.faults.actuators import DRIFT
from sitl_plant.air.disturbance import disturbances
from sitl_plant.air.wind import air_around
from sitl_plant.airframe.contact import height_above_ground
from sitl_plant.airframe.rigid_body import load_state, state_derivative
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe
from sitl_plant.loop.period import describe_loss, is_lost, time_s

CALM = np.zeros(3)
COMMANDS = np.array([0.05, -0.04, 0.3, 800.0])
LAG_S = 0.05
CHANGING = {
    "wind": {
        "steady": {"north_m_s": 2.0, "east_m_s": -1.0},
        "shear": {"east_1_s": 0.05, "altitude_m": 50.0},
        "gust": {"start_s": 0.0, "duration_s": 0.2, "north_m_s": 6.0, "down_m_s": -4.0},
    },
    "servos": {name: {"lag_s": LAG_S} for name in ("aileron", "elevator", "rudder", "throttle")},
}
"""Everything changes within a period."""


def plant_with(scenario: Scenario, **changes: Any) -> PlantState:
    tree = scenario.model_dump() | {"faults": (), "disturbance": {}} | changes
    return new_plant_state(Scenario.model_validate(tree).plant_config())


def level(V: float = 45.0, pitch: float = 0.1) -> np.ndarray:
    """A state 100 m above the ground."""
    x = np.zeros(12)
    x[2], x[3], x[7] = -100.0, V, pitch
    return x


# the integration


def in_detail(plant: PlantState, until: float) -> np.ndarray:
    """The state that servos from rest, a fault, gust and disturbances lead to, by scipy."""

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        reached = COMMANDS * (1.0 - math.exp(-t / LAG_S))
        wave = math.radians(3.0) * math.cos(2.0 * math.pi * 4.0 * t)
        surfaces = (0.5 * reached[0] + wave, reached[1], reached[2])
        d_v, d_omega = disturbances(plant.disturbance, t)
        state = load_state(x)
        air = air_around(plant.wind[0], plant.uavs[0]["turbulence"], state[0], state[2], t)
        derivative = state_derivative(
            state, 700.0 * math.exp(-t / LAG_S) + reached[3], surfaces, d_v, d_omega, air,
            plant.uavs[0]["aircraft"],
        )  # fmt: skip
        return np.ravel(derivative)

    start = plant.uavs[0]["state"].copy()
    return np.asarray(solve_ivp(slope, (0.0, until), start, rtol=1e-11, atol=1e-11).y[:, -1])


def flown(scenario: Scenario, step_us: int, until: float) -> tuple[np.ndarray, np.ndarray]:
    """The state at a time, and the exact one."""
    waves = {"x": {"sin": 3.0, "rate_rad_s": 20.0}, "y": {"cos": 2.0, "rate_rad_s": 15.0}}
    waves["z"] = {"sin": 2.0, "cos": 1.0, "rate_rad_s": 17.0}
    disturbed = {"acceleration_m_s2": waves, "angular_acceleration_rad_s2": waves}
    plant = plant_with(scenario, step_us=step_us, disturbance=disturbed, **CHANGING)
    add_fault(
        plant.uavs[0]["faults"], actuator_fault(AILERON, 0.5, 3.0, 4.0, 0.0, math.inf), now_s=0.0
    )
    plant.uavs[0]["state"][9:12] = 0.4, -0.2, 0.1
    servos = plant.uavs[0]["servos"]
    servos["settled"], servos["shaft"][THROTTLE], servos["output"][THROTTLE] = 1, 700.0, 700.0
    plant.uavs[0]["controls"] = COMMANDS
    exact = in_detail(plant, until)
    for k in range(round(until * 1e6 / step_us)):
        assert fly(plant, k, step_us) < 0
    return plant.uavs[0]["state"].copy(), exact


def test_halving_the_period_leaves_a_sixteenth_of_the_error(scenario1: Scenario) -> None:
    """Of servos with a lag, a fault, disturbances and wind that all change meanwhile."""
    errors = []
    for step_us in (20_000, 10_000):
        x, exact = flown(scenario1, step_us, 0.04)
        errors.append(np.abs(x - exact))
    assert errors[0] == pytest.approx(np.zeros(12), abs=1e-4)
    for part in (slice(3, 6), slice(6, 9), slice(9, 12)):
        orders = math.log2(np.linalg.norm(errors[0][part]) / np.linalg.norm(errors[1][part]))
        assert orders == pytest.approx(4.0, abs=0.7)


def test_the_positions_applied_are_those_at_the_start_of_the_period(scenario1: Scenario) -> None:
    """With a drift of 0.5 rad/s on half of the aileron, from the first step's end on."""
    plant = plant_with(scenario1, step_us=10_000, servos=CHANGING["servos"])
    drift = actuator_fault(AILERON, 0.5, math.degrees(0.5), 0.0, 0.01, math.inf, DRIFT.code)
    add_fault(plant.uavs[0]["faults"], drift, now_s=0.0)
    plant.uavs[0]["servos"]["settled"] = 1
    plant.uavs[0]["controls"] = COMMANDS
    for k in range(4):
        assert fly(plant, k, 10_000) < 0
        reached = COMMANDS * (1.0 - math.exp(-k * 0.01 / LAG_S))
        if k > 0:
            reached[AILERON] = 0.5 * reached[AILERON] + 0.5 * (k - 1) * 0.01
        assert plant.uavs[0]["applied"] == pytest.approx(reached)


# what an accelerometer feels


def test_the_specific_force_is_the_force_at_the_end_of_a_period(scenario1: Scenario) -> None:
    """Along the body: a fault counts at a step if it acted in the period that ends there.

    It doubles the thrust's way from 0 N, at 1e5 N/s from 8 ms on, to 20 ms inclusive.
    """
    plant, step_us = plant_with(scenario1, step_us=4000), 4000
    drift = actuator_fault(THROTTLE, 0.5, 1e5, 0.0, 0.008, 0.020, DRIFT.code)
    add_fault(plant.uavs[0]["faults"], drift, now_s=0.0)
    felt = []
    for step in range(7):
        plant.uavs[0]["servos"]["output"] = COMMANDS
        observe(plant, 0, step, step_us)
        felt.append(plant.uavs[0]["message"]["specific_force"].copy())
    m = plant.uavs[0]["aircraft"]["m"]
    thrust = m * (np.array(felt)[:, 0] - felt[0][0]) + 800.0
    assert thrust == pytest.approx([800.0, 800.0, 800.0, 800.0, 1200.0, 1600.0, 800.0])
    assert np.ptp(np.array(felt)[:, 1:], axis=0) == pytest.approx([0.0, 0.0])


def test_the_specific_force_is_acceleration_without_gravity(scenario1: Scenario) -> None:
    """Against two short periods of flight, in wind and under a disturbance."""
    sizes = {"x": 3.0, "y": -2.0, "z": 5.0}
    waves = {axis: {"cos": size, "rate_rad_s": 2.0} for axis, size in sizes.items()}
    wind = {"steady": {"north_m_s": 7.0, "east_m_s": 4.0}}
    plant = plant_with(scenario1, step_us=10, wind=wind, disturbance={"acceleration_m_s2": waves})
    plant.uavs[0]["controls"] = COMMANDS
    plant.uavs[0]["state"][9:12] = 0.4, -0.2, 0.1
    speeds = []
    for k in range(3):
        speeds.append(plant.uavs[0]["state"][3:6].copy())
        if k == 1:
            observe(plant, 0, k, 10)
            _, v, (roll, pitch, _), omega = load_state(plant.uavs[0]["state"].copy())
        assert fly(plant, k, 10) < 0
    by_motion = (speeds[2] - speeds[0]) / 2e-5 + np.cross(omega, v)
    down = (
        -math.sin(pitch),
        math.cos(pitch) * math.sin(roll),
        math.cos(pitch) * math.cos(roll),
    )
    expected = by_motion - plant.uavs[0]["aircraft"]["g"] * np.array(down)
    assert plant.uavs[0]["message"]["specific_force"] == pytest.approx(expected, abs=1e-3)


# time


@pytest.mark.parametrize(("step", "step_us", "text"), [(3, 100_000, "0.3"), (1001, 700, "0.7007")])
def test_a_time_is_the_nearest_double(step: int, step_us: int, text: str) -> None:
    assert time_s(step, step_us) == float(text)


# where the model ends


def test_the_model_ends_beyond_its_limits() -> None:
    for V in (3.0, 300.0):
        assert not is_lost(level(V), CALM)
    for V in (math.nextafter(3.0, 0.0), math.nextafter(300.0, 999.0)):
        assert is_lost(level(V), CALM)
    for sign in (1.0, -1.0):
        assert not is_lost(level(pitch=sign * math.radians(89.0)), CALM)
        assert is_lost(level(pitch=sign * math.radians(89.001)), CALM)
    for turned in (6, 8):  # roll and yaw have no limit
        x = level()
        x[turned] = math.radians(179.0)
        assert not is_lost(x, CALM)


def test_the_airspeed_that_counts_is_the_length_of_the_motion_through_the_air() -> None:
    x = level()
    x[3:6] = 1.0, -2.0, 2.0
    assert not is_lost(x, CALM)
    assert is_lost(x, np.array([0.0, 0.0, 0.1]))
    assert is_lost(x, np.array([0.0, -0.1, 0.0]))
    assert not is_lost(x, np.array([0.0, 0.1, 0.0]))


@pytest.mark.parametrize("entry", range(12))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_not_finite_is_lost(entry: int, value: float) -> None:
    x = level()
    x[entry] = value
    assert is_lost(x, CALM)
    assert describe_loss(x, CALM) == "its state is not finite"


@pytest.mark.parametrize(("slope_deg", "north_m"), [(0.0, 0.0), (3.0, 200.0), (3.0, -200.0)])
def test_the_ground_is_a_plane_through_the_origin(
    scenario1: Scenario, slope_deg: float, north_m: float
) -> None:
    plant = plant_with(scenario1, ground={"slope_deg": slope_deg})
    gear, altitude = plant.uavs[0]["gear"], math.tan(math.radians(slope_deg)) * north_m
    for above in (-0.5, -1e-9, 1e-9, 2.0):
        height = height_above_ground((north_m, 70.0, -(altitude + above)), gear)
        assert height == pytest.approx(above * math.cos(math.radians(slope_deg)), abs=1e-12)


def test_a_loss_is_described_with_its_limits() -> None:
    x = level(2.0)
    x[3:6], x[7] = (2.0, 0.0, 1.5), math.radians(-30.0)
    text = "pitch -30.0° (limit ±89°), airspeed 2.5 m/s (limits 3 to 300 m/s)"
    assert describe_loss(x, CALM) == text
    assert "airspeed 1.5 m/s" in describe_loss(x, np.array([2.0, 0.0, 0.0]))


@pytest.mark.parametrize("stall_deg", [15.0, 25.0])
@pytest.mark.parametrize("pitch_deg", [-30.0, 89.5])
def test_a_loss_tells_of_a_stall(stall_deg: float, pitch_deg: float) -> None:
    """At 20° of angle of attack through air that rises."""
    x, V, alpha = level(2.0), 30.0, math.radians(20.0)
    rising = np.array([0.0, 0.0, -3.0])
    x[3:6] = np.array([V * math.cos(alpha), 0.0, V * math.sin(alpha)]) + rising
    x[7] = math.radians(pitch_deg)
    said = describe_loss(x, rising, math.radians(stall_deg))
    told = "; it had stalled: angle of attack 20.0°, its stall is at 15.0°"
    assert said == describe_loss(x, rising) + (told if stall_deg == 15.0 else "")


def test_a_hit_of_the_ground_is_described_with_the_rate_of_descent() -> None:
    """40 m/s forward at 30° of pitch and 60° of roll, 4 m/s to the right, 2 m/s down the body."""
    x = level()
    x[3:6], x[6:9] = (40.0, 4.0, 2.0), np.radians([60.0, 30.0, 123.0])
    side, down = 4.0 * math.sqrt(0.75) * math.sqrt(0.75), 2.0 * 0.5 * math.sqrt(0.75)
    sinking = -40.0 * 0.5 + side + down
    assert describe_loss(x, CALM) == f"it hit the ground, sinking at {sinking:.1f} m/s"
    assert sinking == pytest.approx(-16.1, abs=0.05)

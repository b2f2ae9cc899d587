"""Level flight of a simulator, found by Newton's method on what it does.

A simulator is differentiated by steps large beside its noise, and its surfaces end at their stops:
the solver of our own equations (`sitl_plant.airframe.level_flight`) would not hold.
"""

import math
from typing import NamedTuple

import numpy as np

from gcs.console.errors import BadInput
from sitl_plant.airframe.level_flight import velocity_at
from sitl_plant.simulators.base import Motion, Simulator
from sitl_plant.vec3 import Vec3

STEP_S = 1e-3
"""Time between two readings [s]."""
_SPAN = 4  # readings over which an angular acceleration is measured
_ITERATIONS = 30
_AT_REST = 2e-3  # m/s² and rad/s²
_FIRST_ALPHA = 0.05
_STEEPEST = 0.2  # largest change of one iteration: α [rad], share of a stop, of the weight
_MAX_ALPHA = math.radians(30.0)
_STANDARD_GRAVITY = 9.80665


class SimulatorTrim(NamedTuple):
    """Straight, level flight without sideslip, as far as the surfaces can make it."""

    airspeed: float  # m/s
    alpha: float  # rad
    delta: Vec3  # aileron, elevator, rudder [rad]
    thrust: float  # N
    specific_force: Vec3  # body axes [m/s²]
    gravity: float  # m/s²


def motion_at(
    V: float, alpha: float, beta: float = 0.0, rates: Vec3 = (0.0, 0.0, 0.0), altitude: float = 0.0
) -> Motion:
    """Return the motion of level wings and a level path at an airspeed [m/s] and angles [rad]."""
    v = velocity_at(V, alpha, beta)
    return Motion((0.0, 0.0, -altitude), v, (0.0, alpha, 0.0), rates, (0.0, 0.0, 0.0))


def trim(simulator: Simulator, V: float, altitude: float = 0.0) -> SimulatorTrim:
    """Find level flight at an airspeed [m/s] and an altitude [m] of a simulator.

    Raises:
        BadInput: It has none, and why.
    """
    gravity = _gravity(simulator, V, altitude)
    weight = simulator.body.mass_kg * gravity
    half = np.array([0.5 * (high - low) for low, high in simulator.stops])
    middle = np.array([0.5 * (high + low) for low, high in simulator.stops])
    felt: Vec3 = (0.0, 0.0, 0.0)

    def unpacked(u: np.ndarray) -> tuple[float, Vec3, float]:
        da, de, dr = (float(x) for x in middle + half * u[1:4])
        return float(u[0]), (da, de, dr), weight * float(u[4])

    def unrest(u: np.ndarray) -> np.ndarray:
        nonlocal felt
        alpha, delta, thrust = unpacked(u)
        felt, turning = acceleration(
            simulator, motion_at(V, alpha, altitude=altitude), delta, thrust
        )
        along = felt[0] - gravity * math.sin(alpha)
        down = felt[2] + gravity * math.cos(alpha)
        return np.array([along, down, *turning])

    neutral = np.divide(-middle, half, out=np.zeros(3), where=half > 0.0)  # none: no surface
    u = np.array([_FIRST_ALPHA, *neutral, 0.1])
    steps = np.array([1e-3, 1e-2, 1e-2, 1e-2, 1e-3])
    for _ in range(_ITERATIONS):
        left = unrest(u)
        if np.max(np.abs(left)) < _AT_REST:
            break
        columns = [
            (unrest(u + h * e) - unrest(u - h * e)) / (2.0 * h)
            for h, e in zip(steps, np.eye(5), strict=True)
        ]
        if not np.isfinite([left, *columns]).all():
            break
        step = np.linalg.lstsq(np.column_stack(columns), -left, rcond=1e-6)[0]
        u = u + step * min(1.0, _STEEPEST / max(float(np.max(np.abs(step))), 1e-9))
        u[0] = np.clip(u[0], -_MAX_ALPHA, _MAX_ALPHA)
        u[1:4] = np.clip(u[1:4], -1.0, 1.0)
    left = unrest(u)
    if not np.all(np.isfinite(left)) or np.max(np.abs(left)) > 10.0 * _AT_REST:
        raise BadInput(
            _no_trim(V, u, left), "choose another --cruise: a higher one, if it is too slow"
        )
    alpha, delta, thrust = unpacked(u)
    return SimulatorTrim(V, alpha, delta, thrust, felt, gravity)


def _no_trim(V: float, u: np.ndarray, left: np.ndarray) -> str:
    at_stop = [
        name
        for name, share in zip(("aileron", "elevator", "rudder"), u[1:4], strict=True)
        if abs(share) > 0.99
    ]
    why = f"the {' and the '.join(at_stop)} would have to pass the stop" if at_stop else ""
    if abs(u[0]) >= 0.99 * _MAX_ALPHA:
        why = "an angle of attack of 30 deg would not carry it"
    along, down = left[:2]
    if not why and down > abs(along):
        why = "the lift does not carry it"
    if not np.all(np.isfinite(left)):
        return f"no level flight at {V:g} m/s: its accelerations are not finite"
    over = f"{np.max(np.abs(left[:2])):.2g} m/s^2, {np.max(np.abs(left[2:])):.2g} rad/s^2"
    return f"no level flight at {V:g} m/s{f': {why}' if why else ''} (left over: {over})"


def acceleration(
    simulator: Simulator, motion: Motion, delta: Vec3, thrust: float
) -> tuple[Vec3, Vec3]:
    """Return specific force [m/s²] and angular acceleration [rad/s²] of a motion.

    A simulator may act on its inputs a step late, so that the first step is not measured.
    """
    simulator.control(delta, thrust)
    simulator.reset(motion)
    simulator.control(delta, thrust)
    simulator.advance(STEP_S)
    before = simulator.read()
    for _ in range(_SPAN):
        simulator.advance(STEP_S)
    after = simulator.read()
    turning = [(b - a) / (_SPAN * STEP_S) for a, b in zip(before.rates, after.rates, strict=True)]
    return before.specific_force, (turning[0], turning[1], turning[2])


def _gravity(simulator: Simulator, V: float, altitude: float) -> float:
    """Return the gravity of a simulator [m/s²]: what its motion has beyond the specific force."""
    simulator.control((0.0, 0.0, 0.0), 0.0)
    simulator.reset(motion_at(V, _FIRST_ALPHA, altitude=altitude))
    readings = [simulator.read()]
    for _ in range(_SPAN):
        simulator.advance(STEP_S)
        readings.append(simulator.read())
    down = [_down(one.velocity, one) for one in readings]
    felt = np.mean([_down(one.specific_force, one) for one in readings[1:]])
    found = (down[-1] - down[0]) / (_SPAN * STEP_S) - felt
    return round(float(found), 2) if abs(found - _STANDARD_GRAVITY) < 1.0 else _STANDARD_GRAVITY


def _down(vector: Vec3, motion: Motion) -> float:
    """Return the downward component of a vector of body axes."""
    roll, pitch, _ = motion.attitude
    x, y, z = vector
    return -math.sin(pitch) * x + math.cos(pitch) * (math.sin(roll) * y + math.cos(roll) * z)

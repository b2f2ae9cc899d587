"""An experiment on a simulator: short flights about its level flight, all controls moved.

Each begins somewhere else near level flight, and moves every control to random places, so that
all motions are excited independently (persistent excitation).
"""

import math
from collections.abc import Callable

import numpy as np

from ftc_lab.identification.readings import Readings
from ftc_lab.identification.trim import STEP_S, SimulatorTrim, acceleration, motion_at
from gcs.console.errors import BadInput
from sitl_plant.simulators.base import Simulator
from sitl_plant.vec3 import Vec3

SEGMENTS = 120
_HOLDS = 6  # of the controls in one segment
_HOLD_STEPS = 85
_SETTLING_STEPS = 5  # after a change, which a simulator may act on late
_SPEED = 0.15  # of the airspeed, to either side
_ALPHA, _BETA = math.radians(5.0), math.radians(6.0)
_RATES = (0.14, 0.012, 0.07)  # of V/b, V/c, V/b
_THROW = 0.4  # of a surface's way to its stops
_THRUST = 0.5  # of the thrust of level flight
_MARGIN = math.radians(2.0)  # to the stall
_SWEEP_STEP, _SWEEP_END = math.radians(0.5), math.radians(30.0)
_FALL = 0.02  # of the largest lift, by which it has fallen off behind the stall

OnProgress = Callable[[int, int], None]


def stall_of(simulator: Simulator, level: SimulatorTrim, altitude: float = 0.0) -> float | None:
    """Return the angle of attack of the largest lift [rad]; None if there is none up to 30°."""
    best, at = 0.0, level.alpha
    alpha = level.alpha
    while alpha < _SWEEP_END:
        motion = motion_at(level.airspeed, alpha, altitude=altitude)
        (x, _, z), _ = acceleration(simulator, motion, level.delta, level.thrust)
        x -= level.thrust / simulator.body.mass_kg
        lift = x * math.sin(alpha) - z * math.cos(alpha)
        if lift > best:
            best, at = lift, alpha
        elif lift < (1.0 - _FALL) * best:
            return at
        alpha += _SWEEP_STEP
    return None


def experiment(
    simulator: Simulator,
    level: SimulatorTrim,
    seed: int,
    *,
    altitude: float = 0.0,
    stall: float | None = None,
    segments: int = SEGMENTS,
    on_progress: OnProgress = lambda *_: None,
) -> Readings:
    """Fly the experiment.

    Args:
        simulator: What flies.
        level: Its level flight.
        seed: Of all that is random.
        altitude: Where [m].
        stall: Angle of attack that no segment begins near [rad].
        segments: Number of short flights.
        on_progress: Called with the segments flown, and all of them.

    Raises:
        BadInput: Nearly all segments left what can be flown.
    """
    rng = np.random.default_rng(seed)
    V, body = level.airspeed, simulator.body
    rates = np.array(_RATES) * V / np.array([body.wing_span_m, body.mean_chord_m, body.wing_span_m])
    highest = math.inf if stall is None else stall - _MARGIN
    low, high = np.array(simulator.stops).T
    rows: list[tuple[float, ...]] = []
    for segment in range(segments):
        speed = V * (1.0 + _SPEED * rng.uniform(-1.0, 1.0))
        alpha = level.alpha + _ALPHA * rng.uniform(-1.0, 1.0)
        beta = _BETA * rng.uniform(-1.0, 1.0)
        omega = [float(x) for x in rates * rng.uniform(-1.0, 1.0, 3)]
        motion = motion_at(
            speed, min(alpha, highest), beta, (omega[0], omega[1], omega[2]), altitude
        )
        simulator.control(level.delta, level.thrust)
        simulator.reset(motion)
        for hold in range(_HOLDS):
            moved = np.array(level.delta) + _THROW * (high - low) / 2.0 * rng.uniform(-1.0, 1.0, 3)
            da, de, dr = (float(x) for x in np.clip(moved, low, high))
            thrust = max(level.thrust * (1.0 + _THRUST * rng.uniform(-1.0, 1.0)), 0.0)
            if not _hold(simulator, (da, de, dr), thrust, segment * _HOLDS + hold, segment, rows):
                break
        on_progress(segment + 1, segments)
    if len(rows) < _HOLD_STEPS * segments // 2:
        text = "the aircraft left what can be flown in most of the experiment's segments"
        raise BadInput(text, "choose another --cruise, or check the aircraft's stability")
    table = np.array(rows)
    numbers = table[:, 13:].astype(np.int64)
    return Readings(
        dt=STEP_S,
        v=table[:, :3],
        omega=table[:, 3:6],
        force=table[:, 6:9],
        delta=table[:, 9:12],
        thrust=table[:, 12],
        piece=numbers[:, 0],
        group=numbers[:, 1],
    )


def _hold(
    simulator: Simulator,
    delta: Vec3,
    thrust: float,
    piece: int,
    segment: int,
    rows: list[tuple[float, ...]],
) -> bool:
    """Fly on with controls held, and read; return whether the aircraft still flies."""
    simulator.control(delta, thrust)
    simulator.advance(_SETTLING_STEPS * STEP_S)
    for _ in range(_HOLD_STEPS - _SETTLING_STEPS):
        now = simulator.read()
        if not _flies(now.velocity):
            return False
        rows.append(
            (*now.velocity, *now.rates, *now.specific_force, *delta, thrust, piece, segment)
        )
        simulator.advance(STEP_S)
    return True


def _flies(velocity: Vec3) -> bool:
    x, y, z = velocity
    return math.isfinite(x + y + z) and x > abs(y) and x > abs(z)

"""Control steps and situations as laws see them, and one control step of one UAV alone."""

import math
from typing import Any

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.tuples import four
from ftc_autopilot.control.controller import Inputs, Records, control_step
from ftc_autopilot.control.controllers import GUIDANCE
from ftc_autopilot.control.edges import EDGE
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import Seen, Step, Thresholds
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from ftc_autopilot.guidance.coordination import no_coordination
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.path import PathPoint, locate, point_at
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3

NOTHING = (0.0, 0.0, 0.0)
NOBODY = np.zeros(0, EDGE)
COMMANDS = np.array([0.05, 0.08, 0.3, 900.0])  # in force [rad, rad, rad, N]


def step_of(motion: Any, first: bool = False, **changes: Any) -> Step:
    """A step without errors, with the reference at 45 m/s."""
    step = Step(
        t=0.0,
        dt=1e-3,
        first=int(first),
        by_bank=0,
        due=0,
        ahead=0,
        links=0,
        after_gap=0,
        bandwidth=2.5,
        clock_s=(0.0, 0.0, 0.0, 0.0),
        thresholds=Thresholds((0.01, 1.0), (0.01, math.radians(1.0))),
        command=(45.0, 0.0, 0.0, 0.0),
        held=four(COMMANDS),
        filtered=((45.0, 0.0, 0.0), NOTHING, NOTHING, NOTHING),
        errors=FormationErrors(0.0, NOTHING, 0.0, NOTHING, 1.0, 1.0, 0.0, NOTHING),
        motion=motion,
        seen=Seen(motion, 0, 0, 0, 0),
        reference=Reference(45.0, 0.0, NOTHING, NOTHING),
    )
    return step._replace(**changes)


def situation_of(
    motion: Any,
    position: Vec3,
    velocity: Vec3,
    air_velocity: Vec3,
    dt: float = 0.02,
    yaw: float = 0.0,
) -> Situation:
    """A situation without a path, whose reference is level, and at rest but for its yaw."""
    return Situation(
        dt=dt,
        s=0.0,
        bandwidth=2.5,
        command=(0.0, 0.0, 0.0, 0.0),
        position=position,
        velocity=velocity,
        air_velocity=air_velocity,
        reference=(NOTHING, NOTHING, NOTHING, (yaw, 0.0, 0.0)),
        coordination=no_coordination(),
        here=PathPoint(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0),
        motion=motion,
        off=0.0,
    )


def on_path(now: Situation, path: np.void, near: float) -> Situation:
    """The same on a path, near a value of its parameter."""
    s, off = locate(path, now.position[0], now.position[1], near)
    return now._replace(s=s, off=off, here=point_at(path, s))


def step_alone(
    motion: Any,
    command: tuple[float, float, float, float],
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    actuators: np.void,
) -> np.void:
    """Make one control step of a UAV without neighbours; gives its signals."""
    signals: np.void = np.zeros(1, SIGNALS)[0]
    guidance: np.void = np.zeros(1, GUIDANCE)[0]
    guidance["command"] = command
    _step_alone(motion, guidance, NOBODY, aircraft, parameters, state, actuators, signals)
    return signals


@compiled
def _step_alone(
    motion: MeasuredMotion,
    guidance: np.void,
    edges: np.ndarray,
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    actuators: np.void,
    signals: np.void,
) -> None:
    """Call `control_step` with the types that a flight has: its machine code is in the cache."""
    seen = Seen(motion, 0, 0, 0, 0)
    inputs = Inputs(0.0, 1e-3, motion, seen, guidance["command"], edges, math.inf)
    records = Records(
        aircraft, parameters, state, actuators["controls"], signals, guidance["runway"]
    )
    control_step(inputs, records, True)

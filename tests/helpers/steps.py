"""Control steps as laws see them, and one control step of one UAV alone."""

import math
from typing import Any

import numpy as np

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.control.controller import SIGNALS, Inputs, Records, control_step
from ftc_autopilot.control.controllers import GUIDANCE
from ftc_autopilot.control.edges import EDGE
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.step import Seen, Step, Thresholds
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from mavlink_defs.runtime.jit import compiled

NOTHING = (0.0, 0.0, 0.0)
NOBODY = np.zeros(0, EDGE)
COMMANDS = np.array([0.05, 0.08, 0.3, 900.0])  # in force [rad, rad, rad, N]


def step_of(motion: Any, first: bool = False, **changes: Any) -> Step:
    """A step without errors, with the reference at 45 m/s."""
    step = Step(
        t=0.0,
        dt=1e-3,
        first=first,
        motion=motion,
        seen=Seen(motion, 0, 0, False),
        command=np.array([45.0, 0.0, 0.0, 0.0]),
        reference=Reference(45.0, 0.0, NOTHING, NOTHING),
        filtered=np.array([[45.0, 0.0, 0.0], NOTHING, NOTHING, NOTHING]),
        bandwidth=2.5,
        errors=FormationErrors(0.0, NOTHING, 0.0, NOTHING, 1.0, 1.0, 0.0, NOTHING),
        held=COMMANDS.copy(),
        thresholds=Thresholds((0.01, 1.0), (0.01, math.radians(1.0))),
        due=0,
        clock_s=(0.0, 0.0, 0.0, 0.0),
    )
    return step._replace(**changes)


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
    motion: Motion,
    guidance: np.void,
    edges: np.ndarray,
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    actuators: np.void,
    signals: np.void,
) -> None:
    """Call `control_step` with the types that a flight has: its machine code is in the cache."""
    seen = Seen(motion, 0, 0, False)
    inputs = Inputs(0.0, 1e-3, motion, seen, guidance["command"], edges)
    records = Records(aircraft, parameters, state, actuators["controls"], signals)
    control_step(inputs, records, True)

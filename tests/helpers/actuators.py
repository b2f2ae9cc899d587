"""One actuator of the diagnosis, as a test sets it up; all amounts are in degrees.

The numbers are the defaults of `DiagnosisParameters`.
"""

import math

import numpy as np

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.diagnosis import DiagnosisParameters
from ftc_autopilot.control.diagnosis.parameters import Limits
from ftc_autopilot.control.diagnosis.state import ACTUATOR
from ftc_autopilot.control.diagnosis.suspicions import monitor
from sitl_plant.actuators.config import ActuatorServos

DT, FILTER_S = 1e-3, 0.01
LIMITS = Limits(
    jump=2.0,
    smooth_jump=math.inf,
    swing=1.5,
    excitation=1.2,
    runaway=12.0,
    prior=0.4,
    window=0.06,
    confirm=0.008,
    offset=0.06,
    suspicion=0.6,
    ahead=0.005,
    quiet=0.52,
    check=-10.0,
)
SMOOTH = LIMITS._replace(jump=50.0, smooth_jump=0.5)
"""Of an actuator whose jumps only the smoothed residual shows."""
GAINS = np.zeros(1, record_dtype(DiagnosisParameters))[0]
fill(GAINS, DiagnosisParameters().with_servos(ActuatorServos()))


def actuator_with(**fields: float) -> np.void:
    actuator: np.void = np.zeros(1, ACTUATOR)[0]
    actuator["effectiveness"], actuator["decided_s"] = 1.0, 9.0
    for name, value in fields.items():
        actuator[name] = value
    return actuator


def shown(
    r: float, age: float = 3.0, limits: Limits = LIMITS, steps: int = 1, **fields: float
) -> np.void:
    """An actuator with half of its effect, of which some steps show this residual."""
    actuator = actuator_with(effectiveness=0.5, commanded=0.6, measured=0.3 + r, **fields)
    for k in range(steps):
        monitor(actuator, limits, age + k * DT, DT, GAINS)
    return actuator

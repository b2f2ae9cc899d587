"""The faults of actuators.

Another kind is an entry here, one of FTC_FAULT_KIND in `ftc.xml`, and a branch in
`sitl_plant.actuators.faults`, mostly of `offset`.

The aircraft applies ``effectiveness * commanded`` plus what the fault's value adds. The kind says
what that is, and how people name the value.
"""

import math

from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.kinds import Family, Kind, Target

BIAS = Kind(
    "bias",
    dialect.FTC_FAULT_KIND_OFFSET,
    "{sign} {size}{wave}",
    ("Bias of a surface.", "Bias of the throttle."),
    "{unit}",
    partial=True,
    choice="loss and bias",
)
"""A loss of effectiveness alone is a bias of 0."""

STUCK = Kind(
    "stuck",
    dialect.FTC_FAULT_KIND_OFFSET,
    "stuck at {minus}{size}{wave}",
    ("Angle of a stuck surface.", "Thrust of a stuck throttle."),
    "{unit}",
    choice="stuck at value",
    label="stuck at",
)
DRIFT = Kind(
    "drift",
    dialect.FTC_FAULT_KIND_DRIFT,
    "{sign} drift of {size}{wave}",
    ("Rate at which a surface drifts.", "Rate at which the throttle drifts."),
    "{unit}/s",
    partial=True,
    choice="loss and drift",
)
HARDOVER = Kind(
    "hardover",
    dialect.FTC_FAULT_KIND_HARDOVER,
    "runs to {minus}{size}{wave}",
    (
        "Angle to which a surface runs at the rate of its servo.",
        "Thrust to which the engine runs at its rate.",
    ),
    "{unit}",
    choice="hard-over",
    label="runs to",
)
INTERMITTENT = Kind(
    "intermittent",
    dialect.FTC_FAULT_KIND_INTERMITTENT,
    "{sign} {size} on and off{wave}",
    (
        "Bias of a surface in every first half of a period.",
        "Bias of the throttle in every first half of a period.",
    ),
    "{unit}",
    partial=True,
    wave=" at {:g} Hz",
    switches=True,
    label="bias",
)

MAX_FAULTS = 16
"""Faults of actuators that one aircraft can hold at a time."""

_SERVO, _MOTOR = dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_UNIT_SYSTEM_MOTOR

ACTUATOR_FAULTS = Family(
    key="actuator",
    what="an actuator",
    targets=(
        *(Target(name, _SERVO, "deg", math.radians(1.0)) for name in ACTUATORS[:-1]),
        Target(ACTUATORS[-1], _MOTOR, "N"),
    ),
    kinds=(BIAS, STUCK, DRIFT, HARDOVER, INTERMITTENT),
    command=dialect.MAV_CMD_FTC_SET_FAULT,
    params=("number", "effectiveness", "value", "frequency_hz", "start_s", "end_s", "code"),
    most=MAX_FAULTS,
    first=0,
    title="Fault",
    numbers="0, 1, 2 or 3",
    slots="fault slots",
    value_label="Value",
    default_code=dialect.FTC_FAULT_KIND_OFFSET,
)

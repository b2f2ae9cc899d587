"""What a control law is given in one control step, and what it returns."""

from typing import NamedTuple, TypeAlias

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.tuples import Four, Rows
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from mavlink_defs.constants import N_CHANNELS
from sitl_plant.vec3 import Vec3

ALL = 2**N_CHANNELS - 1
"""Mask of all channels; masks have bit numbers as FTC_ACTUATOR."""

ParametersRecord: TypeAlias = np.void
"""Record of dtype `ftc_autopilot.control.controller.PARAMETERS`: of all that a UAV can choose."""
ControllerRecord: TypeAlias = np.void
"""Record of dtype `ftc_autopilot.control.controller.CONTROLLER`, updated in place."""
SignalsRecord: TypeAlias = np.void
"""Record of dtype `ftc_autopilot.control.signals.SIGNALS`: what a step computed, written."""


class Thresholds(NamedTuple):
    """Thresholds of the paper's triggers, as they are at one time."""

    a: tuple[float, float]  # a1 [-], a2 [N] of (25)
    b: tuple[float, float]  # b1 [-], b2 [rad] of (29)


class Seen(NamedTuple):
    """What a measurement shows, which a delay makes older than the step."""

    motion: MeasuredMotion  # as measured; a step's is predicted from it
    ahead: int  # by how many control periods the commands that it shows are older, of surfaces
    links: int  # the same without what is known of servos and sensors
    after_gap: int  # 1: states before it were lost, or the command in force is not known
    unresolved: int  # states lost before it while a command came into force; -1: it is one of them


class Step(NamedTuple):
    """One control step, the same for every law, ours or a plug-in's.

    In memory it begins with struct ftc_law_input, which ends with the motion of `seen`.
    """

    t: float  # time that schedules run on [s]
    dt: float  # control period [s]
    first: int  # 1: this is the law's first step
    by_bank: int  # 1: heading is held by bank, the yaw error is minus the sideslip
    due: int  # mask of the channels that the trigger sends now by the clock
    ahead: int  # this and the next two as of `seen`, where a C function finds them
    links: int
    after_gap: int
    bandwidth: float  # of the reference filter [rad/s]
    clock_s: Four  # period of the trigger's clock by channel [s]; 0: no clock
    thresholds: Thresholds
    command: Four  # unfiltered reference: airspeed [m/s], roll, pitch, yaw [rad]
    held: Four  # commands in force: aileron, elevator, rudder [rad], thrust [N]
    filtered: Rows  # filtered reference and its two derivatives [m/s, rad]
    errors: FormationErrors  # errors against reference and neighbours, (31), (32)
    motion: MeasuredMotion  # own motion, when the commands of this step will act
    seen: Seen
    reference: Reference  # of `filtered`; if heading is held by bank, yaw is the way of flight


class Command(NamedTuple):
    """Commands of a law, before saturation and trigger."""

    delta: Vec3  # aileron, elevator, rudder [rad]
    thrust: float  # N
    channels: int  # mask of those that may be sent; ALL unless the law selects them

"""Guidance laws of plug-ins: what their C functions are given, and what they return.

Such a law is evaluated after the law `path`, whose command it takes, corrects or replaces: how a
UAV gets on along its path, and where it intends to fly, its neighbours hear from `path`. A
plug-in is a subclass of `GuidanceParameters` with a static method `step`, or with a `LIBRARY` that
has the interface of `ftc_autopilot/plugins/ftc_guidance.h`.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.guidance.coordination import Coordination
from ftc_autopilot.guidance.laws.base import GuidanceParameters, Situation
from ftc_autopilot.guidance.path import PathPoint, point_at
from ftc_autopilot.plugins.functions import NOT_FINITE
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import GUIDANCE_LAWS
from ftc_autopilot.plugins.memory import call, call_records, layout_of, tuple_at
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.vec3 import Vec3

PARAMETER_BYTES, STATE_BYTES = 1024, 2048
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype(
    [
        ("step", "u8"),  # address of its C function
        ("init", "u8"),  # 0: it has none
        ("own", [("numbers", "f8", (PARAMETER_BYTES // 8,))]),  # begins with the law's own record
    ]
)
PLUGIN_STATE = np.dtype(
    [
        ("failure", "i8"),  # why it is not called any more; 0 if it is
        ("started", "i8"),  # 0: before its first update
        ("own", [("numbers", "f8", (STATE_BYTES // 8,))]),
    ]
)

Four = tuple[float, float, float, float]


class GuidanceInput(NamedTuple):
    """`Situation` and more as a C function sees it, struct ftc_guidance_input."""

    dt: float
    s: float
    bandwidth: float
    command: Four
    position: Vec3
    velocity: Vec3
    air_velocity: Vec3
    reference: tuple[Vec3, Vec3, Vec3, Vec3]
    coordination: Coordination
    here: PathPoint
    motion: Motion


class GuidanceOutput(NamedTuple):
    """The command as a C function writes it, struct ftc_guidance_output."""

    command: Four


GUIDANCE_INPUT, GUIDANCE_OUTPUT = layout_of(GuidanceInput), layout_of(GuidanceOutput)
LIKE = tuple_at(GuidanceInput, bytes(GUIDANCE_INPUT.itemsize))


@compiled
def plugin_guidance(
    now: Situation,
    path: np.void,
    s: float,
    coordination: Coordination,
    aircraft: AircraftRecord,
    limits: np.void,
    own: np.void,
    state: np.void,
    command: np.ndarray,
) -> None:
    """Call the function of a plug-in, unless it has failed before.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        s: The path parameter [m].
        coordination: Slot and corrections.
        aircraft: Nominal aircraft.
        limits: Record made of `ftc_autopilot.guidance.laws.base.GuidanceParameters`.
        own: Record of dtype `PLUGIN_PARAMETERS`.
        state: Record of dtype `PLUGIN_STATE`, updated in place; `failure` is written if it fails.
        command: What `path` commands: airspeed [m/s], roll, pitch, yaw [rad], shape (4,); written.
    """
    if state["started"] == 0:
        state["started"] = 1
        if own["init"] != 0:
            state["failure"] = call_records(own["init"], (own["own"], state["own"], aircraft))
    if state["failure"] != 0:
        return
    x = now.reference
    before = (command[0], command[1], command[2], command[3])
    given = GuidanceInput(
        now.dt,
        s,
        now.bandwidth,
        before,
        now.position,
        now.velocity,
        now.air_velocity,
        (
            (x[0, 0], x[0, 1], x[0, 2]),
            (x[1, 0], x[1, 1], x[1, 2]),
            (x[2, 0], x[2, 1], x[2, 2]),
            (x[3, 0], x[3, 1], x[3, 2]),
        ),
        coordination,
        point_at(path, s),
        now.motion,
    )
    records = (own["own"], state["own"], aircraft, limits, path)
    status, output = call(own["step"], given, GuidanceOutput(before), records)
    for k in range(4):
        if status == 0 and not math.isfinite(output.command[k]):
            status = NOT_FINITE
    state["failure"] = status
    if status == 0:
        for k in range(4):
            command[k] = output.command[k]


@compiled
def situation_of(given: GuidanceInput, reference: np.ndarray) -> Situation:
    """Return what a C function is given; `reference` as an array, shape (4, 3)."""
    return Situation(
        given.dt,
        given.position,
        given.velocity,
        given.air_velocity,
        given.motion,
        reference,
        given.bandwidth,
    )


@compiled
def output_of(command: Four) -> GuidanceOutput:
    """Return a command as a C function writes it."""
    return GuidanceOutput(
        (float(command[0]), float(command[1]), float(command[2]), float(command[3]))
    )


def own_record(guidance: type[GuidanceParameters]) -> np.dtype:
    """Return the record of a law's own parameters."""
    return record_dtype(guidance, GuidanceParameters)


class UnreadGuidance(GuidanceParameters):
    """A guidance law whose code is not run: any keys, no parameters of its own."""

    model_config = ConfigDict(extra="allow")


GUIDANCE = Interface(
    group=GUIDANCE_LAWS,
    base=GuidanceParameters,
    unread=UnreadGuidance,
    symbol="ftc_guidance",
    counts=(9,),
    signature="(now, path, s, coordination, aircraft, limits, gains, state, command)",
    given=GUIDANCE_INPUT,
    result=GUIDANCE_OUTPUT,
    further=AIRCRAFT.itemsize,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=own_record,
)
"""How guidance laws of plug-ins are called."""

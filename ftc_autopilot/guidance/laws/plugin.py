"""Guidance laws of plug-ins: how their C functions are called.

Such a law is evaluated after the law `path`, whose command it takes, corrects or replaces: how a
UAV gets on along its path, and where it intends to fly, its neighbours hear from `path`. A
plug-in is a subclass of `GuidanceParameters` with a static method `step`, or with a `LIBRARY` that
has the interface of `ftc_autopilot/plugins/ftc_guidance.h`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.common.tuples import Four
from ftc_autopilot.guidance.laws.base import GuidanceParameters, Situation
from ftc_autopilot.plugins.functions import NOT_FINITE
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import GUIDANCE_LAWS
from ftc_autopilot.plugins.memory import (
    call,
    call_records,
    layout_of,
    load,
    offset_of,
    record_at,
    store,
    tuple_at,
)
from ftc_autopilot.plugins.models import ADDRESSES, area
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord

PARAMETER_BYTES, STATE_BYTES = 1024, 2048
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype([*ADDRESSES, area(PARAMETER_BYTES)])
PLUGIN_STATE = np.dtype(
    [
        ("failure", "i8"),  # why it is not called any more; 0 if it is
        ("started", "i8"),  # 0: before its first update
        area(STATE_BYTES),
    ]
)


class GuidanceOutput(NamedTuple):
    """The command as a C function writes it, struct ftc_guidance_output."""

    command: Four


GuidanceInput = Situation
GUIDANCE_INPUT, GUIDANCE_OUTPUT = layout_of(Situation), layout_of(GuidanceOutput)
_LIKE = tuple_at(Situation, bytes(GUIDANCE_INPUT.itemsize))


@compiled
def plugin_guidance(
    now: Situation,
    path: np.void,
    aircraft: AircraftRecord,
    limits: np.void,
    own: np.void,
    state: np.void,
) -> Four:
    """Return the command of a plug-in; if it fails, or has failed before, what `path` commands.

    Args:
        now: The situation, with what `path` commands.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        aircraft: Nominal aircraft.
        limits: Record made of `ftc_autopilot.guidance.laws.base.GuidanceParameters`.
        own: Record of dtype `PLUGIN_PARAMETERS`.
        state: Record of dtype `PLUGIN_STATE`, updated in place; `failure` is written if it fails.
    """
    if state["started"] == 0:
        state["started"] = 1
        if own["init"] != 0:
            state["failure"] = call_records(own["init"], (own["own"], state["own"], aircraft))
    if state["failure"] != 0:
        return now.command
    records = (own["own"], state["own"], aircraft, limits, path)
    status, output = call(own["step"], now, GuidanceOutput(now.command), records)
    for k in range(4):
        if status == 0 and not math.isfinite(output.command[k]):
            status = NOT_FINITE
    state["failure"] = status
    command: Four = output.command if status == 0 else now.command
    return command


@compiled
def _output(command: Four) -> GuidanceOutput:
    airspeed, roll, pitch, yaw = command
    return GuidanceOutput((float(airspeed), float(roll), float(pitch), float(yaw)))


def _entry(step: Callable[..., Four]) -> Callable[..., int]:
    def entry(
        now: Any, out: Any, gains: Any, state: Any, _aircraft: Any, _limits: Any, _path: Any
    ) -> int:
        store(out, _output(step(load(now, _LIKE), record_at(gains), record_at(state))))
        return 0

    return entry


def _entry_with_path(step: Callable[..., Four]) -> Callable[..., int]:
    def entry(
        given: Any, out: Any, gains: Any, state: Any, aircraft: Any, limits: Any, path: Any
    ) -> int:
        now = load(given, _LIKE)
        nominal, most = record_at(aircraft), record_at(limits)
        own, memory = record_at(gains), record_at(state)
        place = record_at(path)
        command = step(now, place, now.s, now.coordination, nominal, most, own, memory, now.command)
        store(out, _output(command))
        return 0

    return entry


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
    entries={
        "now, gains, state": _entry,
        "now, path, s, coordination, aircraft, limits, gains, state, command": _entry_with_path,
    },
    given=Situation,
    known=offset_of(GUIDANCE_INPUT, "off"),
    result=_output,
    output=GuidanceOutput,
    expected="four numbers: airspeed, roll, pitch, yaw",
    records=("gains", "state", "aircraft", "limits", "path"),
    further=AIRCRAFT.itemsize,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=own_record,
)
"""How guidance laws of plug-ins are called."""

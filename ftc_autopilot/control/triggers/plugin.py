"""Triggers of plug-ins: what their C functions are given, and what they return.

A plug-in is a subclass of `TriggerParameters` with a static method `step`, as the functions of our
own triggers, or with a `LIBRARY` that has the interface of `ftc_autopilot/plugins/ftc_trigger.h`.
"""

from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import TRIGGERS
from ftc_autopilot.plugins.memory import call, call_records, layout_of, tuple_at
from mavlink_defs.runtime.jit import compiled

PARAMETER_BYTES, STATE_BYTES = 1024, 2048
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype(
    [
        ("step", "u8"),  # address of its C function
        ("init", "u8"),  # 0: it has none
        (
            "own",
            [("numbers", "f8", (PARAMETER_BYTES // 8,))],
        ),  # begins with the trigger's own record
    ]
)
PLUGIN_STATE = np.dtype(
    [
        ("failure", "i8"),  # why it is not called any more; 0 if it is
        ("own", [("numbers", "f8", (STATE_BYTES // 8,))]),
    ]
)


class TriggerInput(NamedTuple):
    """`Candidates` as a C function sees them, struct ftc_trigger_input."""

    dt: float
    first: int
    selected: int
    commanded: tuple[float, float, float, float]
    held: tuple[float, float, float, float]
    relative: tuple[float, float, float, float]
    absolute: tuple[float, float, float, float]


class TriggerOutput(NamedTuple):
    """The channels that transmit as a C function writes them, struct ftc_trigger_output."""

    channels: int


TRIGGER_INPUT, TRIGGER_OUTPUT = layout_of(TriggerInput), layout_of(TriggerOutput)
LIKE = tuple_at(TriggerInput, bytes(TRIGGER_INPUT.itemsize))
_NONE = TriggerOutput(0)


@compiled
def plugin_trigger(now: Candidates, own: np.void, state: np.void) -> int:
    """Call the function of a plug-in, unless it has failed before; return the channels.

    Args:
        now: The present step.
        own: Record of dtype `PLUGIN_PARAMETERS`.
        state: Record of dtype `PLUGIN_STATE`, updated in place; `failure` is written if it fails.
    """
    if now.first and own["init"] != 0 and state["failure"] == 0:
        state["failure"] = call_records(own["init"], (own["own"], state["own"]))
    if state["failure"] != 0:
        return 0
    held = now.held
    given = TriggerInput(
        now.dt,
        int(now.first),
        int(now.selected),
        now.commanded,
        (held[0], held[1], held[2], held[3]),
        now.relative,
        now.absolute,
    )
    status, output = call(own["step"], given, _NONE, (own["own"], state["own"]))
    state["failure"] = status
    channels: int = output.channels
    return channels


@compiled
def candidates_of(given: TriggerInput, held: np.ndarray) -> Candidates:
    """Return what a C function is given; `held` are its commands in force, shape (4,)."""
    return Candidates(
        given.dt,
        given.first != 0,
        given.commanded,
        held,
        given.selected,
        given.relative,
        given.absolute,
    )


@compiled
def output_of(channels: int) -> TriggerOutput:
    """Return the channels as a C function writes them."""
    return TriggerOutput(int(channels))


def own_record(trigger: type[TriggerParameters]) -> np.dtype:
    """Return the record of a trigger's own parameters."""
    return record_dtype(trigger, TriggerParameters)


class UnreadTrigger(TriggerParameters):
    """A trigger whose code is not run: any keys, no parameters of its own, fit for every law."""

    model_config = ConfigDict(extra="allow")
    BY_CLOCK: ClassVar[bool] = True


TRIGGER = Interface(
    group=TRIGGERS,
    base=TriggerParameters,
    unread=UnreadTrigger,
    symbol="ftc_trigger",
    counts=(3,),
    signature="(now, parameters, state)",
    given=TRIGGER_INPUT,
    result=TRIGGER_OUTPUT,
    further=0,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=own_record,
)
"""How triggers of plug-ins are called."""

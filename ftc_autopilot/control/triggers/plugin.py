"""Triggers of plug-ins: what their C functions are given, and what they return.

A plug-in is a subclass of `TriggerParameters` with a static method `step`, as the functions of our
own triggers, or with a `LIBRARY` that has the interface of `ftc_autopilot/plugins/ftc_trigger.h`.
"""

from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.plugins.functions import (
    ABI,
    Functions,
    Sizes,
    check_room,
    function_of,
    library_functions,
)
from ftc_autopilot.plugins.loading import TRIGGERS, library_of, load_class
from ftc_autopilot.plugins.memory import call, call_records, layout_of, tuple_at
from mavlink_defs.runtime.jit import compiled

SIGNATURE = "(now, parameters, state)"
ARGUMENTS = (3,)

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


def load_trigger(name: str) -> type[TriggerParameters]:
    """Return the trigger of a name, FILE:CLASS or an entry point's; its interface is checked.

    Raises:
        PluginError: It cannot be used.
    """
    trigger = load_class(name, TRIGGERS, TriggerParameters)
    check_room(trigger, lambda: own_record(trigger), trigger.STATE, (PARAMETER_BYTES, STATE_BYTES))
    if library_of(trigger) is not None:
        library_of_trigger(trigger)
    else:
        function_of(trigger, ARGUMENTS, SIGNATURE)
    return trigger


def library_of_trigger(trigger: type[TriggerParameters]) -> Functions:
    """Return the functions of a plug-in's shared library, its interface checked.

    Raises:
        PluginError: It cannot be used.
    """
    sizes = Sizes(
        ABI,
        TRIGGER_INPUT.itemsize,
        TRIGGER_OUTPUT.itemsize,
        0,
        own_record(trigger).itemsize,
        trigger.STATE.itemsize,
    )
    return library_functions(trigger, "ftc_trigger", sizes)

"""Triggers of plug-ins: how their C functions are called.

A plug-in is a subclass of `TriggerParameters` with a static method `step`, as the functions of our
own triggers, or with a `LIBRARY` that has the interface of `ftc_autopilot/plugins/ftc_trigger.h`.
"""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import TRIGGERS
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

PARAMETER_BYTES, STATE_BYTES = 1024, 2048
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype([*ADDRESSES, area(PARAMETER_BYTES)])
PLUGIN_STATE = np.dtype(
    [
        ("failure", "i8"),  # why it is not called any more; 0 if it is
        area(STATE_BYTES),
    ]
)


class TriggerOutput(NamedTuple):
    """The channels that transmit as a C function writes them, struct ftc_trigger_output."""

    channels: int


TriggerInput = Candidates
TRIGGER_INPUT, TRIGGER_OUTPUT = layout_of(Candidates), layout_of(TriggerOutput)
_LIKE = tuple_at(Candidates, bytes(TRIGGER_INPUT.itemsize))
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
    state["failure"], output = call(own["step"], now, _NONE, (own["own"], state["own"]))
    channels: int = output.channels
    return channels


@compiled
def _mask(channels: int) -> TriggerOutput:
    return TriggerOutput(channels | 0)  # of integers only


def _entry(step: Callable[..., int]) -> Callable[..., int]:
    def entry(now: Any, out: Any, parameters: Any, state: Any) -> int:
        store(out, _mask(step(load(now, _LIKE), record_at(parameters), record_at(state))))
        return 0

    return entry


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
    entries={"now, parameters, state": _entry},
    given=Candidates,
    known=offset_of(TRIGGER_INPUT, "examined"),
    result=_mask,
    output=TriggerOutput,
    expected="a mask of channels",
    records=("parameters", "state"),
    further=0,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=own_record,
)
"""How triggers of plug-ins are called."""

"""Laws of plug-ins: how their C functions are called.

A plug-in is a subclass of `LawParameters` with a static method `step`, as the functions of our own
laws, or with a `LIBRARY` that has the interface of `ftc_autopilot/plugins/ftc_law.h`.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command, ControllerRecord, SignalsRecord, Step
from ftc_autopilot.control.transmit import not_finite
from ftc_autopilot.plugins.functions import NOT_FINITE
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import LAWS
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
from ftc_autopilot.plugins.models import ADDRESSES, PLUGIN, area
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord

PARAMETER_BYTES, STATE_BYTES = 4096, 24576
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype(
    [
        *ADDRESSES,
        ("by_bank", "i8"),  # as of `HeadingLoop`
        ("heading_gain_1_s", "f8"),
        ("bank_limit_rad", "f8"),
        area(PARAMETER_BYTES),
    ]
)
PLUGIN_STATE = np.dtype([area(STATE_BYTES)])

LawInput, LawOutput = Step, Command
LAW_INPUT, LAW_OUTPUT = layout_of(Step), layout_of(Command)
_LIKE = tuple_at(Step, bytes(LAW_INPUT.itemsize))
_NOTHING = Command((math.nan, math.nan, math.nan), math.nan, ALL)


@compiled
def plugin_law(
    now: Step,
    aircraft: AircraftRecord,
    own: np.void,
    states: ControllerRecord,
    signals: SignalsRecord,
) -> Command:
    """Call the function of a plug-in, unless it has failed before; then no number is commanded.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        own: Record of dtype `PLUGIN_PARAMETERS`.
        states: `plugin` is updated in place; `law_failure` is written if it fails.
        signals: It may write to it.
    """
    state, status, command = states[PLUGIN], states["law_failure"], _NOTHING
    if now.first and own["init"] != 0 and status == 0:
        status = call_records(own["init"], (own["own"], state["own"], aircraft))
    if status == 0:
        records = (own["own"], state["own"], aircraft, signals)
        status, command = call(own["step"], now, _NOTHING, records)
        if status == 0 and not_finite(command) != 0:
            status = NOT_FINITE
    states["law_failure"] = status
    return command


@compiled
def _command(given: Command) -> Command:
    delta, thrust, channels = given
    surfaces = float(delta[0]), float(delta[1]), float(delta[2])
    return Command(surfaces, float(thrust), int(channels))


def _entry(step: Callable[..., Command]) -> Callable[..., int]:
    def entry(now: Any, out: Any, gains: Any, state: Any, aircraft: Any, _signals: Any) -> int:
        own, memory = record_at(gains), record_at(state)
        store(out, _command(step(load(now, _LIKE), record_at(aircraft), own, memory)))
        return 0

    return entry


def _entry_with_signals(step: Callable[..., Command]) -> Callable[..., int]:
    def entry(now: Any, out: Any, gains: Any, state: Any, aircraft: Any, signals: Any) -> int:
        own, memory, written = record_at(gains), record_at(state), record_at(signals)
        store(out, _command(step(load(now, _LIKE), record_at(aircraft), own, memory, written)))
        return 0

    return entry


class UnreadLaw(LawParameters):
    """A law whose code is not run: any keys, no parameters of its own."""

    model_config = ConfigDict(extra="allow")

    @classmethod
    def goes_with(cls, _mode: str) -> bool:
        """Return True: what it goes with is in its code."""
        return True


LAW = Interface(
    group=LAWS,
    base=LawParameters,
    unread=UnreadLaw,
    symbol="ftc_law",
    entries={
        "now, aircraft, gains, state": _entry,
        "now, aircraft, gains, state, signals": _entry_with_signals,
    },
    given=Step,
    known=offset_of(LAW_INPUT, "seen", "ahead"),
    result=_command,
    output=Command,
    expected="Command(delta, thrust, channels), delta three numbers",
    records=("gains", "state", "aircraft", "signals"),
    further=AIRCRAFT.itemsize,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=lambda law: law.record(),
)
"""How laws of plug-ins are called."""

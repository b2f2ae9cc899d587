"""Laws of plug-ins: what their C functions are given, and what they return.

A plug-in is a subclass of `LawParameters` with a static method `step`, as the functions of our own
laws, or with a `LIBRARY` that has the interface of `ftc_autopilot/plugins/ftc_law.h`.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import ConfigDict

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.reference import read_reference
from ftc_autopilot.control.step import (
    ALL,
    Command,
    ControllerRecord,
    Seen,
    SignalsRecord,
    Step,
    Thresholds,
)
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from ftc_autopilot.control.transmit import not_finite
from ftc_autopilot.plugins.functions import NOT_FINITE
from ftc_autopilot.plugins.interface import Interface
from ftc_autopilot.plugins.loading import LAWS
from ftc_autopilot.plugins.memory import call, call_records, layout_of, tuple_at
from ftc_autopilot.plugins.models import PLUGIN
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.vec3 import Vec3

PARAMETER_BYTES, STATE_BYTES = 4096, 24576
"""Room for parameters and state of a plug-in."""

PLUGIN_PARAMETERS = np.dtype(
    [
        ("step", "u8"),  # address of its C function
        ("init", "u8"),  # 0: it has none
        ("by_bank", "i8"),  # as of `HeadingLoop`
        ("heading_gain_1_s", "f8"),
        ("bank_limit_rad", "f8"),
        ("own", [("numbers", "f8", (PARAMETER_BYTES // 8,))]),  # begins with the law's own record
    ]
)
PLUGIN_STATE = np.dtype([("own", [("numbers", "f8", (STATE_BYTES // 8,))])])


class LawInput(NamedTuple):
    """`Step` as a C function sees it, struct ftc_law_input."""

    t: float
    dt: float
    first: int
    by_bank: int
    due: int
    ahead: int
    links: int
    after_gap: int
    bandwidth: float
    clock_s: tuple[float, float, float, float]
    a: tuple[float, float]
    b: tuple[float, float]
    command: tuple[float, float, float, float]
    held: tuple[float, float, float, float]
    filtered: tuple[Vec3, Vec3, Vec3, Vec3]
    errors: FormationErrors
    motion: Motion
    seen: Motion


class LawOutput(NamedTuple):
    """`Command` as a C function writes it, struct ftc_law_output."""

    delta: Vec3
    thrust: float
    channels: int


LAW_INPUT, LAW_OUTPUT = layout_of(LawInput), layout_of(LawOutput)
LIKE = tuple_at(LawInput, bytes(LAW_INPUT.itemsize))
_NOTHING = LawOutput((math.nan, math.nan, math.nan), math.nan, ALL)


@compiled
def _four(a: np.ndarray) -> tuple[float, float, float, float]:
    return a[0], a[1], a[2], a[3]


@compiled
def _row(a: np.ndarray, i: int) -> Vec3:
    return a[i, 0], a[i, 1], a[i, 2]


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
    state = states[PLUGIN]
    if now.first and own["init"] != 0 and states["law_failure"] == 0:
        records = (own["own"], state["own"], aircraft)
        states["law_failure"] = call_records(own["init"], records)
    if states["law_failure"] != 0:
        return Command(_NOTHING.delta, _NOTHING.thrust, ALL)
    given = LawInput(
        now.t,
        now.dt,
        int(now.first),
        int(now.by_bank),
        int(now.due),
        int(now.seen.ahead),
        int(now.seen.links),
        int(now.seen.after_gap),
        now.bandwidth,
        now.clock_s,
        now.thresholds.a,
        now.thresholds.b,
        _four(now.command),
        _four(now.held),
        (
            _row(now.filtered, 0),
            _row(now.filtered, 1),
            _row(now.filtered, 2),
            _row(now.filtered, 3),
        ),
        now.errors,
        now.motion,
        now.seen.motion,
    )
    status, output = call(
        own["step"], given, _NOTHING, (own["own"], state["own"], aircraft, signals)
    )
    command = Command(output.delta, output.thrust, output.channels)
    if status == 0 and not_finite(command) != 0:
        status = NOT_FINITE
    states["law_failure"] = status
    return command


@compiled
def step_of(given: LawInput, command: np.ndarray, held: np.ndarray, filtered: np.ndarray) -> Step:
    """Return the step that a C function is given.

    Args:
        given: What it is given.
        command: Its `command` as an array, shape (4,).
        held: Its `held`, shape (4,).
        filtered: Its `filtered`, shape (4, 3).
    """
    return Step(
        given.t,
        given.dt,
        given.first != 0,
        given.motion,
        Seen(given.seen, given.ahead, given.links, given.after_gap != 0),
        command,
        read_reference(filtered),
        filtered,
        given.bandwidth,
        given.errors,
        held,
        Thresholds(given.a, given.b),
        given.due,
        given.clock_s,
        given.by_bank != 0,
    )


@compiled
def output_of(command: Command) -> LawOutput:
    """Return a command as a C function writes it."""
    delta = command.delta
    return LawOutput(
        (float(delta[0]), float(delta[1]), float(delta[2])),
        float(command.thrust),
        int(command.channels),
    )


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
    counts=(4, 5),
    signature="(now, aircraft, gains, state) or (now, aircraft, gains, state, signals)",
    given=LAW_INPUT,
    result=LAW_OUTPUT,
    further=AIRCRAFT.itemsize,
    room=(PARAMETER_BYTES, STATE_BYTES),
    record=lambda law: law.record(),
)
"""How laws of plug-ins are called."""

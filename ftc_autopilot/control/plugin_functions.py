"""The C functions of the plug-ins that a controller uses, made of their Python functions."""

import functools
import inspect
from collections.abc import Callable
from typing import Any, Protocol

import numba
import numpy as np

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.control.controller import SIGNALS
from ftc_autopilot.control.laws import LAWS, own_parameters
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.plugin import (
    LAW,
    LAW_INPUT,
    LAW_OUTPUT,
    LIKE,
    LawInput,
    output_of,
    step_of,
)
from ftc_autopilot.control.step import Command, ParametersRecord
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.control.triggers import plugin as triggers
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws import plugin as guidances
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.plugins.functions import (
    Functions,
    array_at,
    compiled_function,
    plain_function,
)
from ftc_autopilot.plugins.loading import line_of
from ftc_autopilot.plugins.memory import bytes_of, load, store, tuple_at
from ftc_autopilot.plugins.models import PLUGIN
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.runtime.jit import is_compiled
from sitl_plant.airframe.aircraft import AIRCRAFT

_LIMITS = record_dtype(GuidanceParameters)
carray: Any = vars(numba)["carray"]  # which type checkers do not see


class Chosen(Protocol):
    """What a UAV flies by: a scenario, or the configuration of a controller."""

    @property
    def controller(self) -> LawParameters:
        """Its control law."""

    @property
    def trigger(self) -> TriggerParameters:
        """Its trigger."""

    @property
    def guidance(self) -> GuidanceParameters:
        """Its guidance law."""


def bind(record: ParametersRecord, chosen: Chosen) -> None:
    """Write to a record of PARAMETERS which functions its plug-ins have; ours have none there.

    Raises:
        PluginError: One cannot be used.
    """
    law, trigger, guidance = chosen.controller, chosen.trigger, chosen.guidance
    if law.kind not in LAWS:
        part = record[PLUGIN]
        part["step"], part["init"] = functions_of(type(law))
        own = own_parameters(record, type(law), law.kind)
        for name in ("by_bank", "heading_gain_1_s", "bank_limit_rad"):
            if name in (own.dtype.names or ()):
                part[name] = own[name]
    if trigger.mode not in TRIGGERS:
        part = record["trigger"][PLUGIN]
        part["step"], part["init"] = functions_of_trigger(type(trigger))
    if guidance.kind not in GUIDANCE_LAWS:
        part = record["guidance"][PLUGIN]
        part["step"], part["init"] = functions_of_guidance(type(guidance))


@functools.cache
def functions_of(law: type[LawParameters]) -> Functions:
    """Return the addresses of the C functions of a plug-in; compiled Python is compiled.

    Raises:
        PluginError: It cannot be used.
    """

    def address_of(function: Callable[..., Command]) -> int:
        takes_signals = len(inspect.signature(inspect.unwrap(function)).parameters) > 4
        if not is_compiled(function):
            return plain_function(_plain(law, function, takes_signals), 6, law)
        records = (LAW_INPUT, LAW_OUTPUT, law.record(), law.STATE, AIRCRAFT, SIGNALS)
        entry = _with_signals(function) if takes_signals else _without_signals(function)
        return compiled_function(entry, records, law)

    return LAW.functions(law, address_of)


def _with_signals(function: Callable[..., Command]) -> Callable[..., int]:
    def entry(given: Any, output: Any, gains: Any, state: Any, aircraft: Any, signals: Any) -> int:
        known = carray(given, 1)[0]
        now = step_of(load(given, LIKE), known["command"], known["held"], known["filtered"])
        own, memory = carray(gains, 1)[0], carray(state, 1)[0]
        command = function(now, carray(aircraft, 1)[0], own, memory, carray(signals, 1)[0])
        store(output, output_of(command))
        return 0

    return entry


def _without_signals(function: Callable[..., Command]) -> Callable[..., int]:
    def entry(given: Any, output: Any, gains: Any, state: Any, aircraft: Any, _signals: Any) -> int:
        known = carray(given, 1)[0]
        now = step_of(load(given, LIKE), known["command"], known["held"], known["filtered"])
        own, memory = carray(gains, 1)[0], carray(state, 1)[0]
        store(output, output_of(function(now, carray(aircraft, 1)[0], own, memory)))
        return 0

    return entry


def _plain(
    law: type[LawParameters], function: Callable[..., Command], takes_signals: bool
) -> Callable[..., None]:
    """Return what calls a plain function with the values at addresses."""
    own, state_type = law.record(), law.STATE
    plainly_step_of, plainly_output_of = inspect.unwrap(step_of), inspect.unwrap(output_of)

    def work(given: int, output: int, gains: int, state: int, aircraft: int, signals: int) -> None:
        known = array_at(given, LAW_INPUT)
        (command,), (held,), (filtered,) = (known[name] for name in ("command", "held", "filtered"))
        now = plainly_step_of(tuple_at(LawInput, known.tobytes()), command, held, filtered)
        arguments = [array_at(aircraft, AIRCRAFT)[0], array_at(gains, own)[0]]
        arguments += [array_at(state, state_type)[0]]
        arguments += [array_at(signals, SIGNALS)[0]] if takes_signals else []
        commanded = function(now, *arguments)
        try:
            written = bytes_of(plainly_output_of(Command(*commanded)))
        except (TypeError, ValueError, IndexError, OverflowError):
            expected = "Command(delta, thrust, channels), delta three numbers"
            text = f"{line_of(function)}: step: expected {expected}, got {commanded!r}"
            raise PluginError(text) from None
        array_at(output, LAW_OUTPUT)[:] = np.frombuffer(written, LAW_OUTPUT)

    return work


@functools.cache
def functions_of_trigger(trigger: type[TriggerParameters]) -> Functions:
    """Return the addresses of the C functions of a plug-in; compiled Python is compiled.

    Raises:
        PluginError: It cannot be used.
    """

    def address_of(function: Callable[..., int]) -> int:
        if not is_compiled(function):
            return plain_function(_plain_trigger(trigger, function), 4, trigger)
        own = triggers.own_record(trigger)
        records = (triggers.TRIGGER_INPUT, triggers.TRIGGER_OUTPUT, own, trigger.STATE)
        return compiled_function(_compiled_trigger(function), records, trigger)

    return triggers.TRIGGER.functions(trigger, address_of)


def _compiled_trigger(function: Callable[..., int]) -> Callable[..., int]:
    like, candidates_of, output = triggers.LIKE, triggers.candidates_of, triggers.output_of

    def entry(given: Any, out: Any, parameters: Any, state: Any) -> int:
        now = candidates_of(load(given, like), carray(given, 1)[0]["held"])
        store(out, output(function(now, carray(parameters, 1)[0], carray(state, 1)[0])))
        return 0

    return entry


def _plain_trigger(
    trigger: type[TriggerParameters], function: Callable[..., int]
) -> Callable[..., None]:
    own, state_type = triggers.own_record(trigger), trigger.STATE
    candidates_of = inspect.unwrap(triggers.candidates_of)

    def work(given: int, out: int, parameters: int, state: int) -> None:
        known = array_at(given, triggers.TRIGGER_INPUT)
        now = candidates_of(tuple_at(triggers.TriggerInput, known.tobytes()), known["held"][0])
        channels = function(now, array_at(parameters, own)[0], array_at(state, state_type)[0])
        if not isinstance(channels, int | np.integer):
            text = f"{line_of(function)}: step: expected a mask of channels, got {channels!r}"
            raise PluginError(text)
        array_at(out, triggers.TRIGGER_OUTPUT)["channels"] = channels

    return work


@functools.cache
def functions_of_guidance(guidance: type[GuidanceParameters]) -> Functions:
    """Return the addresses of the C functions of a plug-in; compiled Python is compiled.

    Raises:
        PluginError: It cannot be used.
    """

    def address_of(function: Callable[..., Any]) -> int:
        if not is_compiled(function):
            return plain_function(_plain_guidance(guidance, function), 7, guidance)
        own, given = guidances.own_record(guidance), guidances.GUIDANCE_INPUT
        output = guidances.GUIDANCE_OUTPUT
        records = (given, output, own, guidance.STATE, AIRCRAFT, _LIMITS, PATH)
        return compiled_function(_compiled_guidance(function), records, guidance)

    return guidances.GUIDANCE.functions(guidance, address_of)


def _compiled_guidance(function: Callable[..., Any]) -> Callable[..., int]:
    like, situation_of, output = guidances.LIKE, guidances.situation_of, guidances.output_of

    def entry(
        given: Any, out: Any, gains: Any, state: Any, aircraft: Any, limits: Any, path: Any
    ) -> int:
        known = load(given, like)
        now = situation_of(known, carray(given, 1)[0]["reference"])
        commanded = function(
            now,
            carray(path, 1)[0],
            known.s,
            known.coordination,
            carray(aircraft, 1)[0],
            carray(limits, 1)[0],
            carray(gains, 1)[0],
            carray(state, 1)[0],
            known.command,
        )
        store(out, output(commanded))
        return 0

    return entry


def _plain_guidance(
    guidance: type[GuidanceParameters], function: Callable[..., Any]
) -> Callable[..., None]:
    own, state_type = guidances.own_record(guidance), guidance.STATE
    situation_of = inspect.unwrap(guidances.situation_of)
    output = inspect.unwrap(guidances.output_of)

    def work(
        given: int, out: int, gains: int, state: int, aircraft: int, limits: int, path: int
    ) -> None:
        memory = array_at(given, guidances.GUIDANCE_INPUT)
        known = tuple_at(guidances.GuidanceInput, memory.tobytes())
        commanded = function(
            situation_of(known, memory["reference"][0]),
            array_at(path, PATH)[0],
            known.s,
            known.coordination,
            array_at(aircraft, AIRCRAFT)[0],
            array_at(limits, _LIMITS)[0],
            array_at(gains, own)[0],
            array_at(state, state_type)[0],
            known.command,
        )
        try:
            written = bytes_of(output(commanded))
        except (TypeError, ValueError, IndexError):
            expected = "four numbers: airspeed, roll, pitch, yaw"
            text = f"{line_of(function)}: step: expected {expected}, got {commanded!r}"
            raise PluginError(text) from None
        array_at(out, guidances.GUIDANCE_OUTPUT)[:] = np.frombuffer(
            written, guidances.GUIDANCE_OUTPUT
        )

    return work

"""One control step of one UAV: measured motion in, held actuator command out.

The order within a step at time t is: read the reference, evaluate the law with its estimates
as they are, advance the estimates by one explicit Euler step to t + dt, trigger, advance the
reference filter.
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.phases import HEALTHY
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.common.schedule import scheduled
from ftc_autopilot.common.tuples import four, rows_of
from ftc_autopilot.control.config import FormationTrigger
from ftc_autopilot.control.ground import ground_law
from ftc_autopilot.control.heading import along_flight, bank_for
from ftc_autopilot.control.laws import (
    KINDS,
    LAWS,
    PLUGIN_LAW,
    Controller,
    evaluate,
    heading_loop,
    own_parameters,
)
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.plugin import PLUGIN_PARAMETERS, PLUGIN_STATE
from ftc_autopilot.control.reference import filter_reference, read_reference, start_filter
from ftc_autopilot.control.step import (
    Command,
    ControllerRecord,
    ParametersRecord,
    Seen,
    SignalsRecord,
    Step,
    Thresholds,
)
from ftc_autopilot.control.synchronisation_errors import formation_errors
from ftc_autopilot.control.transmit import not_finite, transmit
from ftc_autopilot.control.triggers import MODES, PLUGIN_MODE, TRIGGERS, clock_of
from ftc_autopilot.control.triggers import plugin as trigger_plugins
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.guidance.failsafe_parameters import FailsafeParameters
from ftc_autopilot.guidance.formation import FormationParameters
from ftc_autopilot.guidance.laws import GUIDANCE_PARAMETERS, Guidance, guidance_record
from ftc_autopilot.guidance.runway import RUNWAY_FIGURES, RunwayFigures, runway_record
from ftc_autopilot.guidance.runway_state import on_ground
from ftc_autopilot.plugins.models import PLUGIN, owned
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import Vec3, clamp

NO_INTERVAL = 2**32 - 1
"""Smallest interval of a channel with fewer than two events."""


def _record_of_triggers() -> np.dtype:
    """Return the record of the thresholds, and of what each trigger has beyond them."""
    common = record_dtype(TriggerParameters)
    own = {mode: record_dtype(trigger, TriggerParameters) for mode, trigger in TRIGGERS.items()}
    return np.dtype(
        [
            *((name, common[name]) for name in common.names or ()),
            *((mode, record) for mode, record in own.items() if record.names),
            (PLUGIN, trigger_plugins.PLUGIN_PARAMETERS),
        ]
    )


PARAMETERS = np.dtype(
    [
        ("law", "i8"),  # index in KINDS, or PLUGIN_LAW
        ("common", record_dtype(LawParameters)),
        ("mode", "i8"),  # of the trigger, index in MODES, or PLUGIN_MODE
        ("trigger", _record_of_triggers()),
        ("formation_triggered", "i8"),  # 0: a neighbour message in every step
        ("formation_trigger", record_dtype(FormationTrigger)),
        ("guidance", GUIDANCE_PARAMETERS),
        ("runway", RUNWAY_FIGURES),
        ("failsafe", record_dtype(FailsafeParameters)),
        ("formation", record_dtype(FormationParameters)),
        *((kind, law.record()) for kind, law in LAWS.items()),
        (PLUGIN, PLUGIN_PARAMETERS),  # last, as of CONTROLLER
    ]
)

CONTROLLER = np.dtype(
    [
        *((kind, law.STATE) for kind, law in LAWS.items()),
        ("law_failure", "i8"),  # of a plug-in: why it is not called any more; 0 if it is
        (
            "trigger",
            [
                *((mode, one.STATE) for mode, one in TRIGGERS.items() if one.STATE.names),
                (PLUGIN, trigger_plugins.PLUGIN_STATE),
            ],
        ),
        ("command", "f8", (4,)),  # unfiltered reference: airspeed, attitude [m/s, rad]
        ("reference", "f8", (4, 3)),  # airspeed, attitude: value and two derivatives, SI, rad
        ("held", "f8", (N_CHANNELS,)),  # aileron, elevator, rudder [rad], thrust [N]
        ("started", "i8"),  # 0: the next step is the law's first one since the UAV was armed
        ("steps", "i8"),  # control steps made
        ("messages", "i8"),  # steps in which at least one channel had an event
        ("events", "i8", (N_CHANNELS,)),
        ("last_event", "i8", (N_CHANNELS,)),  # step of the channel's last event
        ("min_interval", "i8", (N_CHANNELS,)),  # smallest interval between two events [steps]
        ("not_finite", "i8", (N_CHANNELS,)),  # steps with a demand that was not finite, so not sent
        ("neighbour_messages", "i8"),  # steps after the first with a message to the neighbours
        (PLUGIN, PLUGIN_STATE),  # last, so that a checkpoint can leave it out
    ]
)


def parameter_record(
    controller: Controller,
    trigger: TriggerParameters,
    formation: FormationTrigger | None = None,
    guidance: Guidance | None = None,
    in_space: FormationParameters | None = None,
    runway: RunwayFigures | None = None,
    failsafe: FailsafeParameters | None = None,
) -> np.void:
    """Turn a UAV's configuration into a record of `PARAMETERS`.

    Triggers of the commands that are not chosen, to which a vehicle may change in flight, have
    their defaults.
    """
    record: np.void = np.zeros(1, PARAMETERS)[0]
    record["law"] = number_of(controller.kind)
    fill(record["common"], controller)
    record["mode"] = MODES.index(trigger.mode) if trigger.mode in MODES else PLUGIN_MODE
    fill(record["trigger"], trigger)
    for mode, one in TRIGGERS.items():
        if mode in record["trigger"].dtype.names:
            fill(record["trigger"][mode], trigger if mode == trigger.mode else one(mode=mode))
    if trigger.mode not in MODES:
        own = trigger_plugins.own_record(type(trigger))
        fill(owned(record["trigger"][PLUGIN], own), trigger)
    if formation is not None:
        record["formation_triggered"] = 1
        fill(record["formation_trigger"], formation)
    if guidance is not None:
        record["guidance"] = guidance_record(guidance)
    if runway is not None:
        record["runway"] = runway_record(runway)
    if in_space is not None:
        fill(record["formation"], in_space)
    if failsafe is not None:
        fill(record["failsafe"], failsafe)
    controller.write_to(own_parameters(record, type(controller), controller.kind))
    return record


def number_of(kind: str) -> int:
    """Return the number of a law, which all plug-ins share."""
    return KINDS.index(kind) if kind in LAWS else PLUGIN_LAW


def new_controller() -> np.void:
    """Return a controller before its first step, dtype `CONTROLLER`."""
    state: ControllerRecord = np.zeros(1, CONTROLLER)[0]
    state["min_interval"] = NO_INTERVAL
    return state


def restart_law(state: ControllerRecord) -> None:
    """Let the law start again with the next step; held commands and counters stay.

    Args:
        state: Record of dtype `CONTROLLER`, updated in place.
    """
    state["started"] = state["law_failure"] = 0
    state["trigger"] = np.zeros((), CONTROLLER["trigger"])
    for part in (*LAWS, PLUGIN):
        state[part] = np.zeros((), CONTROLLER[part])


class Inputs(NamedTuple):
    """What a control step of one UAV is made from."""

    t: float  # time that the parameters' schedules run on [s]
    dt: float  # control period [s]
    motion: MeasuredMotion  # own motion
    seen: Seen
    command: np.ndarray  # unfiltered reference: airspeed [m/s], roll, pitch, yaw [rad], shape (4,)
    edges: np.ndarray  # what is known of each neighbour, dtype EDGE, shape (degree,)
    bank_max: float  # of a heading that is held by bank [rad]; infinite: the law's own limit


class Records(NamedTuple):
    """The records of one UAV's controller."""

    aircraft: AircraftRecord  # nominal aircraft, dtype `sitl_plant.airframe.aircraft.AIRCRAFT`
    parameters: ParametersRecord  # dtype `PARAMETERS`
    state: ControllerRecord  # dtype `CONTROLLER`, updated in place
    controls: np.ndarray  # HIL_ACTUATOR_CONTROLS.controls, updated in place
    signals: SignalsRecord  # dtype `SIGNALS`, written
    runway: np.void  # dtype `ftc_autopilot.guidance.runway_state.RUNWAY_STATE`


@inlined
def control_step(inputs: Inputs, records: Records, may_send: bool = True) -> int:
    """Make one control step.

    On the ground `ground_law` flies in place of the law.

    The reference starts at the command in the very first step, and at the present motion when
    the law starts again in flight.

    Args:
        inputs: What it is made from.
        records: Its records.
        may_send: Whether the trigger is asked. A step whose state was lost is made without: it is
            not counted and has no events.

    Returns:
        Bit mask of the channels that had an event, bit numbers as FTC_ACTUATOR; an actuator
        message is due unless it is 0.
    """
    aircraft, parameters, state = records.aircraft, records.parameters, records.state
    controls, signals = records.controls, records.signals
    now = _step(inputs, aircraft, parameters, state)
    for i in range(N_CHANNELS):
        signals["predicted_exit"][i] = math.nan
    signals["dead_steps"] = 0  # of a law without diagnosis, too
    if on_ground(records.runway["phase"]):
        command = ground_law(now, aircraft, records.runway, parameters["runway"])
    else:
        flown = along_flight(now, aircraft["g"]) if now.by_bank != 0 else now
        command = evaluate(flown, aircraft, parameters, state, signals)
    mask = 0
    if may_send:
        examined = _examined(signals)
        mask = transmit(command, now, aircraft, parameters, state, controls, examined)
        state["started"] = 1
        state["steps"] += 1

    _record_signals(signals, now, command, state["held"], mask)
    filter_reference(state["command"], state["reference"], now.bandwidth, now.dt)
    return mask


@inlined
def _examined(signals: SignalsRecord) -> int:
    """Return the mask of the channels whose actuator the diagnosis suspects, or has lost."""
    mask = 0
    for i in range(N_CHANNELS):
        if signals["phase"][i] != HEALTHY:
            mask |= 1 << i
    return mask


@inlined
def _step(
    inputs: Inputs,
    aircraft: AircraftRecord,
    parameters: ParametersRecord,
    state: ControllerRecord,
) -> Step:
    """Return the step as the law sees it; the roll command is the heading's if bank holds that."""
    t, dt, motion, seen, asked, edges, bank_max = inputs
    command = state["command"]
    for i in range(4):
        command[i] = asked[i]
    first = state["started"] == 0
    if state["steps"] == 0:
        start_filter(command, state["reference"])
    elif first:
        roll, pitch, yaw = motion.phi
        start_filter(np.array([motion.V, roll, pitch, yaw]), state["reference"])
    loop, bandwidth = heading_loop(parameters), parameters["common"]["reference_bandwidth_rad_s"]
    if loop.by_bank:
        bank = bank_for(motion, state["reference"], bandwidth, loop, aircraft["g"])
        command[1] = clamp(bank, -bank_max, bank_max)
        if state["steps"] == 0:
            start_filter(command, state["reference"])
    reference, common = read_reference(state["reference"]), parameters["common"]
    trigger = parameters["trigger"]
    a = scheduled(trigger["a1"], t)[0], scheduled(trigger["a2_n"], t)[0]
    b = scheduled(trigger["b1"], t)[0], scheduled(trigger["b2_rad"], t)[0]
    due, clock_s = clock_of(parameters["mode"], dt, trigger, state["trigger"])
    return Step(
        t=t,
        dt=dt,
        first=int(first),
        by_bank=int(loop.by_bank),
        due=due,
        ahead=seen.ahead,
        links=seen.links,
        after_gap=seen.after_gap,
        bandwidth=bandwidth,
        clock_s=clock_s,
        thresholds=Thresholds(a, b),
        command=four(command),
        held=four(state["held"]),
        filtered=rows_of(state["reference"]),
        errors=formation_errors(motion, reference, edges, common),
        motion=motion,
        seen=seen,
        reference=reference,
    )


@inlined
def _record_signals(
    signals: SignalsRecord, now: Step, command: Command, held: np.ndarray, mask: int
) -> None:
    """Write what a step computed, and the commands held after it.

    A law's inner quantities are written by the law.
    """
    motion, reference, errors = now.motion, now.reference, now.errors
    signals["V"], signals["V_dot"], signals["events"] = motion.V, motion.V_dot, mask
    signals["not_finite"] = not_finite(command)
    _write(signals["reference"], reference.V, reference.phi)
    _write(signals["reference_dot"], reference.V_dot, reference.phi_dot)
    _write(signals["error"], errors.V_tilde, errors.e)
    _write(signals["sync_error"], errors.V_tilde_prime, errors.e_prime)
    for i in range(3):
        signals["attitude"][i] = motion.phi[i]
        signals["demand"][i] = command.delta[i]
    signals["demand"][THROTTLE] = command.thrust
    for i in range(N_CHANNELS):
        signals["command"][i] = now.command[i]
        signals["held"][i] = held[i]


@compiled
def count_events(mask: int, step: int, state: ControllerRecord) -> None:
    """Count the events of one step.

    Args:
        mask: Channels that had an event, not 0.
        step: Step number of the measured state.
        state: Record of dtype `CONTROLLER`, updated in place.
    """
    for i in range(N_CHANNELS):
        if mask & (1 << i):
            if state["events"][i] > 0:
                interval = step - state["last_event"][i]
                state["min_interval"][i] = min(state["min_interval"][i], interval)
            state["events"][i] += 1
            state["last_event"][i] = step
    state["messages"] += 1


@compiled
def _write(row: np.ndarray, airspeed: float, attitude: Vec3) -> None:
    row[0] = airspeed
    row[1], row[2], row[3] = attitude

"""Controllers of one or more UAVs: from a measured state to the messages that it causes.

The autopilot process holds the controller of one UAV, the flight in one process those of all.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import (
    CONTROLLER,
    PARAMETERS,
    SIGNALS,
    control_step,
    count_events,
    new_controller,
    no_signals,
    parameter_record,
)
from ftc_autopilot.control.delay import (
    DELAY,
    interpolate,
    lost_states,
    note_commands,
    note_state,
    predicted,
)
from ftc_autopilot.control.motion import Motion, fill_neighbour_state, motion_of
from ftc_autopilot.control.neighbour_messages import (
    extrapolate,
    is_message_due,
    refer_to_reference,
)
from ftc_autopilot.control.reference import PROFILE, profile_value
from ftc_autopilot.guidance.path import PATH
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.aircraft import AIRCRAFT, aircraft_record

__all__ = [
    "GUIDANCE",
    "NOT_STARTED",
    "Controllers",
    "Source",
    "announce",
    "controller_step",
    "new_controllers",
    "reset_controllers",
    "tell_neighbours",
]

NOT_STARTED = -(2**62)

_NO_SIGNALS = no_signals(1)


class Source(IntEnum):
    """Where the unfiltered reference comes from."""

    COMMAND = 0
    """It stays as it is."""
    PROFILE = 1
    """From the profile, by the mission's clock."""
    PATH = 2
    """From guidance along the path."""


GUIDANCE = np.dtype(
    [
        ("active", "i8"),  # 1: armed, the controller runs
        ("follows", "i8"),  # a `Source`
        ("start_step", "i8"),  # step at which the mission's clock is 0, or NOT_STARTED
        ("command", "f8", (4,)),  # airspeed [m/s], roll, pitch, yaw [rad]
    ]
)


class Controllers(NamedTuple):
    """Arrays over n UAVs."""

    aircraft: np.ndarray  # (n,), dtype AIRCRAFT, nominal
    parameters: np.ndarray  # (n,), dtype PARAMETERS
    states: np.ndarray  # (n,), dtype CONTROLLER
    guidance: np.ndarray  # (n,), dtype GUIDANCE
    profiles: np.ndarray  # (n,), dtype PROFILE
    paths: np.ndarray  # (n,), dtype PATH
    neighbour_states: np.ndarray  # (n, degree), dtype NEIGHBOUR: last messages, by neighbour
    extrapolated: np.ndarray  # (n, degree + 1), the same now; last, what neighbours make of `told`
    weights: np.ndarray  # (n, degree), a_ij; 0 while a neighbour is silent
    actuators: np.ndarray  # (n,), dtype ACTUATORS: the actuator message in force
    own_states: np.ndarray  # (n,), dtype NEIGHBOUR: what a message to the neighbours would say
    told: np.ndarray  # (n,), dtype NEIGHBOUR: the last message to the neighbours
    signals: np.ndarray  # (n,), dtype SIGNALS
    delays: np.ndarray  # (n,), dtype DELAY


def new_controllers(configs: Sequence[AutopilotConfig]) -> Controllers:
    """Return the controllers of the given UAVs before the first step: no profile, not active."""
    n = len(configs)
    degree = max((len(config.neighbours) for config in configs), default=0)
    controllers = Controllers(
        np.zeros(n, AIRCRAFT),
        np.zeros(n, PARAMETERS),
        np.zeros(n, CONTROLLER),
        np.zeros(n, GUIDANCE),
        np.zeros(n, PROFILE),
        np.zeros(n, PATH),
        np.zeros((n, degree), NEIGHBOUR),
        np.zeros((n, degree + 1), NEIGHBOUR),
        np.zeros((n, degree)),
        np.zeros(n, ACTUATORS),
        np.zeros(n, NEIGHBOUR),
        np.zeros(n, NEIGHBOUR),
        np.zeros(n, SIGNALS),
        np.zeros(n, DELAY),
    )
    for i, config in enumerate(configs):
        controllers.aircraft[i] = aircraft_record(config.aircraft)
        controllers.parameters[i] = parameter_record(
            config.controller, config.trigger, config.formation_trigger
        )
        law = controllers.parameters[i][config.controller.kind]
        config.controller.derive(config.aircraft, law)
    reset_controllers(controllers)
    return controllers


def reset_controllers(controllers: Controllers) -> None:
    """Return to before the first step, not active; parameters, profiles and paths stay."""
    for array in (
        controllers.guidance,
        controllers.neighbour_states,
        controllers.extrapolated,
        controllers.actuators,
        controllers.own_states,
        controllers.told,
        controllers.signals,
        controllers.delays,
    ):
        array[:] = np.zeros((), array.dtype)
    controllers.weights[:] = 0.0
    controllers.states[:] = new_controller()
    controllers.guidance["start_step"] = NOT_STARTED


@compiled
def announce(controllers: Controllers, i: int, measured: np.void) -> None:
    """Set the message that UAV i sends to its neighbours before the first step.

    Args:
        controllers: The controllers.
        i: Index of the UAV.
        measured: FTC_SIM_STATE payload.
    """
    fill_neighbour_state(
        motion_of(measured, controllers.aircraft[i]), measured["step"], controllers.own_states[i]
    )
    controllers.told[i] = controllers.own_states[i]


@compiled
def controller_step(controllers: Controllers, i: int, measured: np.void, step_us: int) -> int:
    """Make one step from a measured state: own state, guidance, control, actuator message.

    Of states lost before it the law makes the steps, too, but sends nothing.

    Args:
        controllers: Arrays over UAVs; own state, controller state, actuator message and signals of
            UAV i are updated.
        i: Index of the UAV.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].

    Returns:
        Bit mask of the channels that had an event; the actuator message is due unless it is 0.
    """
    delay = controllers.delays[i]
    if controllers.states[i]["started"] != 0:
        for _ in range(lost_states(delay, measured, step_us)):
            _step(controllers, i, interpolate(delay, measured), step_us, False)
    mask = _step(controllers, i, measured, step_us, True)
    note_state(delay, measured)
    if mask != 0:
        count_events(mask, int(measured["step"]), controllers.states[i])
        controllers.actuators[i]["time_usec"] = measured["time_usec"]
    return mask


@compiled
def _step(controllers: Controllers, i: int, measured: np.void, step_us: int, may_send: bool) -> int:
    """Make one step of UAV i; return the mask of events, which are made only if it may send."""
    known_s = controllers.parameters[i]["common"]["delay_s"]
    delay, aircraft = controllers.delays[i], controllers.aircraft[i]
    motion = motion_of(predicted(delay, measured, known_s, step_us, aircraft), aircraft)
    fill_neighbour_state(motion, measured["step"], controllers.own_states[i])
    mask = 0
    if controllers.guidance[i]["active"] != 0:
        mask = _control(controllers, i, measured, motion, step_us, may_send)
    elif may_send:
        mask = _cut_thrust(controllers, i, motion)
    note_commands(delay, int(np.int64(measured["step"])), controllers.states[i]["held"])
    return mask


@compiled
def tell_neighbours(controllers: Controllers, i: int, step: int, step_us: int) -> bool:
    """Return whether UAV i sends `own_states` to its neighbours after a step; it is noted then.

    Args:
        controllers: Arrays over UAVs; message told, counter and signals of UAV i are updated.
        i: Index of the UAV.
        step: The step, which `controller_step` has made.
        step_us: Control period [µs].
    """
    parameters, own, told = controllers.parameters[i], controllers.own_states[i], controllers.told
    if parameters["formation_triggered"] != 0:
        dt, extrapolated = step_us / 1e6, controllers.extrapolated[i, -1]
        extrapolate(told[i], step, dt, extrapolated)
        if not is_message_due(own, told[i], extrapolated, dt, parameters["formation_trigger"]):
            controllers.signals[i]["neighbour_message"] = 0
            return False
    told[i] = own
    counted = 1 if step > 0 else 0  # the first message is known before the start
    controllers.signals[i]["neighbour_message"] = counted
    controllers.states[i]["neighbour_messages"] += counted
    return True


@compiled
def _neighbours_now(controllers: Controllers, i: int, step: int, dt: float) -> np.ndarray:
    """Return what UAV i knows of its neighbours in a step, dtype NEIGHBOUR, shape (degree,)."""
    known: np.ndarray = controllers.neighbour_states[i]
    if controllers.parameters[i]["formation_triggered"] != 0:
        messages, known = known, controllers.extrapolated[i, : len(known)]
        for d in range(len(messages)):  # a step uses neighbour states of the step before
            told = int(np.int64(messages[d]["step"]))
            extrapolate(messages[d], max(step - 1, told), dt, known[d])
    return known


@compiled
def _control(
    controllers: Controllers,
    i: int,
    measured: np.void,
    motion: Motion,
    step_us: int,
    may_send: bool,
) -> int:
    """Follow the profile or the command; the UAV is armed."""
    guidance = controllers.guidance[i]
    clock = 0.0  # schedules belong to the profile, so they run on the mission's clock
    if guidance["start_step"] != NOT_STARTED:
        clock = (measured["step"] - guidance["start_step"]) * step_us / 1e6
    if guidance["follows"] == Source.PROFILE:
        profile_value(controllers.profiles[i], clock, guidance["command"])
    dt = step_us / 1e6
    mask = control_step(
        clock,
        dt,
        motion,
        guidance["command"],
        _neighbours_now(controllers, i, int(np.int64(measured["step"])), dt),
        controllers.weights[i],
        controllers.aircraft[i],
        controllers.parameters[i],
        controllers.states[i],
        controllers.actuators[i]["controls"],
        controllers.signals[i],
        may_send,
    )
    if controllers.parameters[i]["formation_triggered"] != 0:
        refer_to_reference(controllers.own_states[i], controllers.signals[i])
    return mask


@compiled
def _cut_thrust(controllers: Controllers, i: int, motion: Motion) -> int:
    """Set the thrust to zero, an event of the throttle; the surfaces stay. The UAV is disarmed.

    Only measured and held signals are recorded; no law is evaluated.
    """
    held, signals = controllers.states[i]["held"], controllers.signals[i]
    mask = 0
    if held[THROTTLE] != 0.0:
        controllers.actuators[i]["controls"][THROTTLE] = 0.0
        held[THROTTLE] = 0.0
        mask = 1 << THROTTLE
    copy_record(signals, _NO_SIGNALS[0])
    signals["V"], signals["V_dot"], signals["events"] = motion.V, motion.V_dot, mask
    for k in range(3):
        signals["attitude"][k] = motion.phi[k]
    for c in range(N_CHANNELS):
        signals["held"][c] = held[c]
    return mask

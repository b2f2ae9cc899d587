"""Everything aboard one or more UAVs between a received state and what has to be sent.

The autopilot process holds a crew of one; the closed loop in one process holds a crew of all.
"""

from collections.abc import Sequence
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
from ftc_autopilot.control.motion import Motion, motion_of, report
from ftc_autopilot.control.reference import PROFILE, profile_value
from ftc_autopilot.control.trigger import CHANNELS, THROTTLE
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR
from mavlink_defs.runtime.jit import compiled
from sitl_plant.aircraft import AIRCRAFT, aircraft_record

__all__ = ["GUIDANCE", "NOT_STARTED", "Crew", "announce", "new_crew", "onboard_step",
           "reset_crew"]  # fmt: skip

NOT_STARTED = -(2**62)

_NO_SIGNALS = no_signals(1)

GUIDANCE = np.dtype(
    [
        ("active", "i8"),  # 1: armed, the controller runs
        ("auto", "i8"),  # 1: fly the profile; 0: fly `command`
        ("start_step", "i8"),  # step at which the mission's clock is 0, or NOT_STARTED
        ("command", "f8", (4,)),  # airspeed [m/s], roll, pitch, yaw [rad]
    ]
)


class Crew(NamedTuple):
    """Arrays over n UAVs."""

    aircraft: np.ndarray  # (n,), dtype AIRCRAFT, nominal
    parameters: np.ndarray  # (n,), dtype PARAMETERS
    controllers: np.ndarray  # (n,), dtype CONTROLLER
    guidance: np.ndarray  # (n,), dtype GUIDANCE
    profiles: np.ndarray  # (n,), dtype PROFILE
    inboxes: np.ndarray  # (n, degree), dtype NEIGHBOUR: last word of each neighbour
    weights: np.ndarray  # (n, degree), a_ij; 0 while a neighbour is silent
    actuators: np.ndarray  # (n,), dtype ACTUATORS: the actuator message in force
    reports: np.ndarray  # (n,), dtype NEIGHBOUR: own word to the neighbours
    signals: np.ndarray  # (n,), dtype SIGNALS


def new_crew(configs: Sequence[AutopilotConfig]) -> Crew:
    """The crew of the given UAVs, before the first step: no profile, not active."""
    n = len(configs)
    degree = max((len(config.neighbours) for config in configs), default=0)
    crew = Crew(
        np.zeros(n, AIRCRAFT),
        np.zeros(n, PARAMETERS),
        np.zeros(n, CONTROLLER),
        np.zeros(n, GUIDANCE),
        np.zeros(n, PROFILE),
        np.zeros((n, degree), NEIGHBOUR),
        np.zeros((n, degree)),
        np.zeros(n, ACTUATORS),
        np.zeros(n, NEIGHBOUR),
        np.zeros(n, SIGNALS),
    )
    for i, config in enumerate(configs):
        crew.aircraft[i] = aircraft_record(config.aircraft)
        crew.parameters[i] = parameter_record(config.controller, config.trigger)
    reset_crew(crew)
    return crew


def reset_crew(crew: Crew) -> None:
    """Put a crew back before its first step, not active; parameters and profiles stay."""
    for array in (crew.guidance, crew.inboxes, crew.actuators, crew.reports, crew.signals):
        array[:] = np.zeros((), array.dtype)
    crew.weights[:] = 0.0
    crew.controllers[:] = new_controller()
    crew.guidance["start_step"] = NOT_STARTED


@compiled
def announce(crew: Crew, i: int, measured: np.void) -> None:
    """Write what UAV i tells its neighbours about a measured state into its report.

    Args:
        crew: The crew.
        i: Index of the UAV.
        measured: FTC_SIM_STATE payload.
    """
    report(motion_of(measured, crew.aircraft[i]), measured["step"], crew.reports[i])


@compiled
def onboard_step(crew: Crew, i: int, measured: np.void, step_us: int) -> int:
    """Work on one measured state: report, guidance, control step, actuator message.

    Args:
        crew: The crew; report, controller, actuator message and signals of UAV i are updated.
        i: Index of the UAV.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].

    Returns:
        Bit mask of the channels that had an event; the actuator message is due unless it is 0.
    """
    motion = motion_of(measured, crew.aircraft[i])
    report(motion, measured["step"], crew.reports[i])
    if crew.guidance[i]["active"] != 0:
        mask = _control(crew, i, measured, motion, step_us)
    else:
        mask = _cut_thrust(crew, i, motion)
    if mask != 0:
        count_events(mask, int(measured["step"]), crew.controllers[i])
        crew.actuators[i]["time_usec"] = measured["time_usec"]
    return mask


@compiled
def _control(crew: Crew, i: int, measured: np.void, motion: Motion, step_us: int) -> int:
    """Armed: follow the profile or the command."""
    guidance = crew.guidance[i]
    clock = 0.0  # schedules belong to the profile, so they run on the mission's clock
    if guidance["start_step"] != NOT_STARTED:
        clock = (measured["step"] - guidance["start_step"]) * step_us / 1e6
    if guidance["auto"] != 0:
        profile_value(crew.profiles[i], clock, guidance["command"])
    return control_step(
        clock,
        step_us / 1e6,
        motion,
        guidance["command"],
        crew.inboxes[i],
        crew.weights[i],
        crew.aircraft[i],
        crew.parameters[i],
        crew.controllers[i],
        crew.actuators[i]["controls"],
        crew.signals[i],
    )


@compiled
def _cut_thrust(crew: Crew, i: int, motion: Motion) -> int:
    """Disarmed: thrust goes to zero, an event of the throttle; the surfaces stay.

    Signals are what is measured and held; the law has none.
    """
    held, signals = crew.controllers[i]["held"], crew.signals[i]
    mask = 0
    if held[THROTTLE] != 0.0:
        crew.actuators[i]["controls"][THROTTLE] = 0.0
        held[THROTTLE] = 0.0
        mask = 1 << THROTTLE
    crew.signals[i] = _NO_SIGNALS[0]
    signals["V"], signals["V_dot"], signals["events"] = motion.V, motion.V_dot, mask
    for k in range(3):
        signals["attitude"][k] = motion.phi[k]
    for c in range(CHANNELS):
        signals["held"][c] = held[c]
    return mask

"""Controllers of one or more UAVs: their records, before and between flights.

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
    new_controller,
    parameter_record,
)
from ftc_autopilot.control.reference import PROFILE
from ftc_autopilot.control.state_predictor import (
    DELAY,
)
from ftc_autopilot.guidance.coordination import FORMATION, new_formation
from ftc_autopilot.guidance.formation import LAYOUT, layout_record
from ftc_autopilot.guidance.laws import GUIDANCE_STATE
from ftc_autopilot.guidance.path import PATH
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR
from sitl_plant.aircraft import AIRCRAFT, aircraft_record

NOT_STARTED = -(2**62)


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
        ("guided_step", "i8"),  # of the last update of the guidance law, or NOT_STARTED
        ("path_position", "f8"),  # path parameter then [m]
        ("in_slot", "i8"),  # 1: a member of a formation flies in its slot, not on the path itself
        ("law", GUIDANCE_STATE),
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
    layouts: np.ndarray  # (n,), dtype LAYOUT: the formation, as each of its members sees it
    formations: np.ndarray  # (n,), dtype FORMATION
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
        np.zeros(n, LAYOUT),
        np.zeros(n, FORMATION),
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
            config.controller,
            config.trigger,
            config.formation_trigger,
            config.guidance,
            config.formation,
        )
        if config.formation is not None:
            edges = {neighbour.id: neighbour.weight for neighbour in config.neighbours}
            controllers.layouts[i] = layout_record(
                config.formation, config.id, config.leader_access, edges
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
    controllers.formations[:] = new_formation()
    controllers.guidance["start_step"] = controllers.guidance["guided_step"] = NOT_STARTED


def begin_path(guidance: np.void, near: float = 0.0, *, in_slot: bool = True) -> None:
    """Let the references come from the path from the next step on.

    Args:
        guidance: Record of dtype `GUIDANCE`, updated in place.
        near: Path parameter of a point near the UAV [m].
        in_slot: Whether a member of a formation is to fly in its slot.
    """
    guidance["follows"] = Source.PATH
    guidance["in_slot"] = int(in_slot)
    guidance["guided_step"] = NOT_STARTED
    guidance["path_position"] = near
    guidance["law"] = np.zeros((), GUIDANCE_STATE)

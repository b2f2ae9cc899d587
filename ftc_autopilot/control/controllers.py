"""Controllers of one or more UAVs: their records, before and between flights.

An autopilot process holds the controller of one UAV, a flight in one process all controllers.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Annotated, NamedTuple, get_type_hints

import numpy as np

from ftc_autopilot.control.config import ControllerConfig
from ftc_autopilot.control.controller import (
    CONTROLLER,
    PARAMETERS,
    SIGNALS,
    new_controller,
    parameter_record,
)
from ftc_autopilot.control.laws import own_parameters
from ftc_autopilot.control.plugin_functions import bind
from ftc_autopilot.control.reference import PROFILE
from ftc_autopilot.control.state_predictor import DELAY
from ftc_autopilot.guidance.aircraft_limits import for_aircraft
from ftc_autopilot.guidance.coordination import FORMATION, new_formation
from ftc_autopilot.guidance.formation import LAYOUT, layout_record
from ftc_autopilot.guidance.laws import GUIDANCE_STATE
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.plugins.loading import calling
from ftc_autopilot.plugins.models import PLUGIN
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
    """Arrays over n UAVs, each with its dtype, and how many more columns than neighbours it has."""

    aircraft: Annotated[np.ndarray, AIRCRAFT]  # nominal
    parameters: Annotated[np.ndarray, PARAMETERS]
    states: Annotated[np.ndarray, CONTROLLER]
    guidance: Annotated[np.ndarray, GUIDANCE]
    profiles: Annotated[np.ndarray, PROFILE]
    paths: Annotated[np.ndarray, PATH]
    layouts: Annotated[np.ndarray, LAYOUT]  # the formation, as each of its members sees it
    formations: Annotated[np.ndarray, FORMATION]
    neighbour_states: Annotated[np.ndarray, NEIGHBOUR, 0]  # last messages, by neighbour
    extrapolated: Annotated[np.ndarray, NEIGHBOUR, 1]  # the same now; last, of the own broadcast
    weights: Annotated[np.ndarray, np.float64, 0]  # a_ij; 0 while a neighbour is silent
    actuators: Annotated[np.ndarray, ACTUATORS]  # the actuator message in force
    own_states: Annotated[np.ndarray, NEIGHBOUR]  # what a message to the neighbours would say
    last_broadcast: Annotated[np.ndarray, NEIGHBOUR]  # the last message to the neighbours
    signals: Annotated[np.ndarray, SIGNALS]
    delays: Annotated[np.ndarray, DELAY]


_LASTING = {"aircraft", "parameters", "profiles", "paths", "layouts"}
"""What a reset leaves alone."""


def new_controllers(configs: Sequence[ControllerConfig]) -> Controllers:
    """Return the controllers of the given UAVs before the first step: no profile, not active.

    Raises:
        PluginError: A plug-in cannot be used.
    """
    controllers = unbound_controllers(configs)
    bind_plugins(controllers, configs)
    return controllers


def unbound_controllers(configs: Sequence[ControllerConfig]) -> Controllers:
    """Return the same to read their parameters: plug-ins have no functions, and cannot fly."""
    n = len(configs)
    degree = max((len(config.neighbours) for config in configs), default=0)
    arrays = []
    for hint in get_type_hints(Controllers, include_extras=True).values():
        dtype, *more = hint.__metadata__
        arrays.append(np.zeros((n, *(degree + columns for columns in more)), dtype))
    controllers = Controllers(*arrays)
    for i, config in enumerate(configs):
        controllers.aircraft[i] = aircraft_record(config.aircraft)
        controllers.parameters[i] = parameter_record(
            config.controller,
            config.trigger,
            config.formation_trigger,
            for_aircraft(config.guidance, config.aircraft),
            config.formation,
        )
        if config.formation is not None:
            edges = {neighbour.id: neighbour.weight for neighbour in config.neighbours}
            controllers.layouts[i] = layout_record(
                config.formation, config.id, config.leader_access, edges
            )
        law = own_parameters(
            controllers.parameters[i], type(config.controller), config.controller.kind
        )
        with calling(type(config.controller), "derive"):
            config.controller.derive(config.aircraft, law)
    reset_controllers(controllers)
    return controllers


def without_plugin(records: np.ndarray) -> np.ndarray:
    """Return the memory of one record of PARAMETERS or CONTROLLER, but for a plug-in's, uint8."""
    end = dict(records.dtype.fields or {})[PLUGIN][1]
    return records.reshape(1).view(np.uint8)[:end]


def bind_plugins(controllers: Controllers, configs: Sequence[ControllerConfig]) -> None:
    """Write the addresses of the functions of plug-ins, which are of this process only.

    Args:
        controllers: `parameters` are updated.
        configs: Of the UAVs.

    Raises:
        PluginError: One cannot be used.
    """
    for record, config in zip(controllers.parameters, configs, strict=True):
        bind(record, config)


def reset_controllers(controllers: Controllers) -> None:
    """Return to before the first step, not active; parameters, profiles and paths stay."""
    for name, array in controllers._asdict().items():
        if name not in _LASTING:
            array[:] = np.zeros((), array.dtype)
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

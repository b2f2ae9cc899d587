"""Controllers of one or more UAVs: their records, before and between flights.

An autopilot process holds the controller of one UAV, a flight in one process all controllers.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.config import ControllerConfig
from ftc_autopilot.control.controller import (
    CONTROLLER,
    PARAMETERS,
    new_controller,
    parameter_record,
)
from ftc_autopilot.control.edges import EDGE
from ftc_autopilot.control.laws import own_parameters
from ftc_autopilot.control.plugin_functions import bind
from ftc_autopilot.control.reference import PROFILE
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.state_predictor import DELAY
from ftc_autopilot.guidance.aircraft_limits import for_aircraft
from ftc_autopilot.guidance.coordination import FORMATION, new_formation
from ftc_autopilot.guidance.formation import LAYOUT, layout_record
from ftc_autopilot.guidance.laws import GUIDANCE_STATE
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.guidance.runway import figures_of
from ftc_autopilot.guidance.runway_state import RUNWAY_STATE
from ftc_autopilot.plugins.loading import calling
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR
from sitl_plant.airframe.aircraft import AIRCRAFT, aircraft_record

NOT_STARTED = -(2**62)


class ReferenceSource(IntEnum):
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
        ("follows", "i8"),  # a `ReferenceSource`
        ("start_step", "i8"),  # step at which the mission's clock is 0, or NOT_STARTED
        ("command", "f8", (4,)),  # airspeed [m/s], roll, pitch, yaw [rad]
        ("guided_step", "i8"),  # of the last update of the guidance law, or NOT_STARTED
        ("path_position", "f8"),  # path parameter then [m]
        ("unplaced", "i8"),  # 1: it has had no fix, and does not know where it is
        ("in_slot", "i8"),  # 1: a member of a formation flies in its slot, not on the path itself
        ("runway", RUNWAY_STATE),
        ("law", GUIDANCE_STATE),
    ]
)


UAV = np.dtype(
    [
        ("aircraft", AIRCRAFT),  # nominal
        ("layout", LAYOUT),  # the formation, as this member sees it
        ("own_state", NEIGHBOUR),  # what a message to the neighbours would say
        ("extrapolated", NEIGHBOUR),  # what the neighbours make of the last one now
        ("signals", SIGNALS),
        ("delay", DELAY),
        # from here on a checkpoint saves it
        ("profile", PROFILE),
        ("guidance", GUIDANCE),
        ("formation", FORMATION),
        ("actuators", ACTUATORS),  # the actuator message in force
        ("last_broadcast", NEIGHBOUR),  # the last message to the neighbours
        ("parameters", PARAMETERS),
        ("controller", CONTROLLER),
    ]
)
"""The controller of one UAV, but for its path and its neighbours."""

_LASTING = {"aircraft", "parameters", "profile", "layout"}
"""What a reset leaves alone."""


class Controllers(NamedTuple):
    """The controllers of n UAVs, and their neighbours."""

    uavs: np.ndarray  # (n,), dtype UAV
    edges: np.ndarray  # (n, degree), dtype EDGE
    paths: np.ndarray  # (n,), dtype PATH: large, and seldom changed

    def of(self, i: int) -> tuple[np.void, np.ndarray, np.void]:
        """Return record, edges and path of a UAV, as `stepping.controller_step` takes them."""
        return self.uavs[i], self.edges[i], self.paths[i]


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
    controllers = Controllers(np.zeros(n, UAV), np.zeros((n, degree), EDGE), np.zeros(n, PATH))
    for uav, config in zip(controllers.uavs, configs, strict=True):
        uav["aircraft"] = aircraft_record(config.aircraft)
        uav["parameters"] = parameter_record(
            config.controller,
            config.trigger,
            config.formation_trigger,
            for_aircraft(config.guidance, config.aircraft),
            config.formation,
            figures_of(
                config.runway_guidance,
                config.guidance,
                config.aircraft,
                config.controller.reference_bandwidth_rad_s,
            ),
            config.failsafe,
        )
        if config.formation is not None:
            weights = {neighbour.id: neighbour.weight for neighbour in config.neighbours}
            uav["layout"] = layout_record(
                config.formation, config.id, config.leader_access, weights
            )
        law = own_parameters(uav["parameters"], type(config.controller), config.controller.kind)
        with calling(type(config.controller), "derive"):
            config.controller.derive(config.aircraft, law)
    reset_controllers(controllers)
    return controllers


def bind_plugins(controllers: Controllers, configs: Sequence[ControllerConfig]) -> None:
    """Write the addresses of the functions of plug-ins, which are of this process only.

    Args:
        controllers: `parameters` are updated.
        configs: Of the UAVs.

    Raises:
        PluginError: One cannot be used.
    """
    for uav, config in zip(controllers.uavs, configs, strict=True):
        bind(uav["parameters"], config)


def reset_controllers(controllers: Controllers) -> None:
    """Return to before the first step, not active; parameters, profiles and paths stay."""
    for name in UAV.names or ():
        if name not in _LASTING:
            controllers.uavs[name] = np.zeros((), UAV[name])
    for name in ("weight", "known", "message"):
        controllers.edges[name] = np.zeros((), EDGE[name])
    controllers.uavs["controller"] = new_controller()
    controllers.uavs["formation"] = new_formation()
    guidance = controllers.uavs["guidance"]
    guidance["start_step"] = guidance["guided_step"] = NOT_STARTED


def begin_path(guidance: np.void, near: float = 0.0, *, in_slot: bool = True) -> None:
    """Let the references come from the path from the next step on.

    Args:
        guidance: Record of dtype `GUIDANCE`, updated in place.
        near: Path parameter of a point near the UAV [m].
        in_slot: Whether a member of a formation is to fly in its slot.
    """
    guidance["follows"] = ReferenceSource.PATH
    guidance["in_slot"] = int(in_slot)
    guidance["guided_step"] = NOT_STARTED
    guidance["path_position"] = near
    guidance["law"] = np.zeros((), GUIDANCE_STATE)

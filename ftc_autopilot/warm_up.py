"""Call all that an autopilot calls in flight once, so that it is compiled, or loaded if it was."""

import contextlib
import math
import socket
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ftc_autopilot.config import AutopilotConfig, parts_of
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.stepping import PATH_PARTS, RUNWAY_PARTS, controller_step
from ftc_autopilot.estimation.estimator import estimate
from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.members import cause_of, policy_of, state_of
from ftc_autopilot.guidance.path import locate, path_record, point_at
from ftc_autopilot.hot.checkpoint import save
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.loop import new_loops, run
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.kinds import FtcAutopilot
from ftc_autopilot.vehicle.vehicle import VehicleServices
from mavlink_defs.config.files import load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.runtime.jit import apart_in, cold_parts
from mavlink_defs.runtime.jit import load as load_code


def warm_up_with(config_file: Path) -> None:
    """Call everything with the configuration of one autopilot, unless it cannot be used."""
    with contextlib.suppress(ConfigError, PluginError):
        config = load(config_file, AutopilotConfig)
        if isinstance(config.autopilot, FtcAutopilot):  # a bridge needs none of it
            call_everything(config)


PARTS: Mapping[str, Callable[[], None]] = MappingProxyType(
    {
        "controller": partial(load_code, controller_step),
        **{f"law {kind}": partial(load_code, *apart_in(LAWS[kind].__module__)) for kind in LAWS},
        "estimator": partial(load_code, estimate),
        "guidance": partial(load_code, *PATH_PARTS),
        "runway": partial(load_code, *RUNWAY_PARTS),
    }
)
"""What is compiled apart, and how it is compiled, or loaded if it was."""


def call_everything(config: AutopilotConfig) -> None:
    """Call all that a process calls; of what is compiled apart, what it may need and is cached."""
    call_loop(config)
    call_messages(config)
    has_gear = config.aircraft.gear is not None
    used = parts_of(config.controller, config.navigation, on_path=True, has_gear=has_gear)
    for part in set(used) - set(cold_parts(used)):
        PARTS[part]()


def call_loop(config: AutopilotConfig) -> None:
    """Let the compiled loop poll for a state that does not come."""
    autopilots = new_autopilots([config], 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        fd = sock.fileno()
        run(new_loops(autopilots, [(fd, fd, fd)]))
    save(autopilots.checkpoint, autopilots.own, autopilots.edges)


def call_messages(config: AutopilotConfig) -> None:
    """Make every message."""
    path = endless_path()
    locate(path, 0.0, 0.0, 0.0)
    point_at(path, 0.0)
    for part_of in (state_of, cause_of, policy_of):
        part_of(0)
    autopilots = new_autopilots([config])
    (telemetry, *_) = VehicleServices(
        config, HotState(autopilots), autopilots.controllers
    ).telemetry
    for message_id in telemetry.available:
        telemetry.make(message_id)


def endless_path() -> np.void:
    """Return a straight and level path to the north, record of dtype `PATH`."""
    return path_record([Leg(0.0, 0.0, 0.0, 0.0, math.inf, airspeed_m_s=40.0, item=1)])

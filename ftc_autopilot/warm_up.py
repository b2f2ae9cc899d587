"""Call all that an autopilot calls in flight once, so that it is compiled, or loaded if it was."""

import contextlib
import socket
from pathlib import Path

from ftc_autopilot import link as autopilot_link
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.hot_state import HotState
from ftc_autopilot.vehicle.vehicle import Vehicle
from mavlink_defs.config.files import load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.endpoint import set_receive_timeout

__all__ = ["call_everything", "warm_up_with"]


def warm_up_with(config_file: Path) -> None:
    """Call everything with the configuration of one autopilot, unless it cannot be used."""
    with contextlib.suppress(ConfigError):
        call_everything(load(config_file, AutopilotConfig))


def call_everything(config: AutopilotConfig) -> None:
    """Make every message, and let the compiled loop wait for a state that does not come."""
    controllers = new_controllers([config])
    link = autopilot_link.new_link(config.id, config.neighbours, config.step_us, 1.0, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        set_receive_timeout(sock, 1e-3)
        fd = sock.fileno()
        autopilot_link.run(fd, fd, fd, link, controllers, 0.0, 0)
    (telemetry, *_) = Vehicle(config, HotState(link), controllers).telemetry
    for message_id in telemetry.available:
        telemetry.make(message_id)

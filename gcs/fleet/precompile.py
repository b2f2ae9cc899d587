"""Compile the numeric core ahead of its first use, once for all processes."""

import socket

from ftc_autopilot import link as autopilot_link
from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.hot_state import HotState
from ftc_autopilot.vehicle.telemetry import DEFAULT_INTERVALS_US
from ftc_autopilot.vehicle.vehicle import Vehicle
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from gcs.station.vehicle import PRIVATE_INTERVALS_S
from gcs.theory import check_theory
from mavlink_defs.endpoint import set_receive_timeout
from mavlink_defs.runtime.jit import mark_cache_warm, not_cached
from sitl_plant import link as plant_link
from sitl_plant.fleet import new_plant_state

__all__ = ["compile_everything"]


def compile_everything(scenario: Scenario) -> None:
    """Call every compiled entry point once, so that its machine code is in the cache.

    Args:
        scenario: Any scenario; a few steps of it are flown in process.

    Raises:
        ConfigError: The cache cannot be written.
    """
    try:
        _call_everything(scenario)
        mark_cache_warm()
    except OSError as problem:
        raise not_cached(problem) from problem


def _call_everything(scenario: Scenario) -> None:
    short = scenario.model_copy(update={"duration_s": 2 * scenario.step_us / 1e6})
    flight = fly_in_process(short)
    summarise(flight, short)
    check_theory(flight, short)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        set_receive_timeout(sock, 1e-3)
        fd = sock.fileno()
        plant = short.plant_config(speed=None)
        fleet = new_plant_state(plant)
        link = plant_link.new_link([uav.id for uav in plant.uavs], plant.step_us, 1, None, 1)
        plant_link.run(fd, link, fleet, 0.0)
        plant_link.send_states(fd, link, fleet, False)
        autopilot = short.autopilot_config(short.uavs[0].id)
        controllers = new_controllers([autopilot])
        own = autopilot_link.new_link(autopilot.id, autopilot.neighbours, plant.step_us, 1.0, 1)
        autopilot_link.run(fd, fd, own, controllers, 0.0, 0)
        telemetry = Vehicle(autopilot, HotState(own), controllers).telemetry[0]
        for message_id in (*DEFAULT_INTERVALS_US, *PRIVATE_INTERVALS_S):
            telemetry.make(message_id)

"""Compile the numeric core ahead of its first use, once for all processes."""

import socket

from ftc_autopilot.warm_up import call_everything
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
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
        link = plant_link.new_link([uav.id for uav in plant.uavs], plant.step_us, 1, None, True)
        plant_link.run(fd, link, fleet, 0.0)
        plant_link.send_states(fd, link, fleet, False)
    call_everything(short.autopilot_config(short.uavs[0].id))

"""Call all that a plant calls in flight once, so that it is compiled, or loaded if it was."""

import socket

from mavlink_defs.endpoint import set_receive_timeout
from sitl_plant.config import PlantConfig
from sitl_plant.loop.fleet import new_plant_state
from sitl_plant.loop.link import new_link, run, send_states
from sitl_plant.loop.period import time_s


def call_everything(config: PlantConfig) -> None:
    """Send states to nobody, and let the compiled loop wait for answers that do not come."""
    fleet = new_plant_state(config)
    link = new_link([uav.id for uav in config.uavs], config.step_us, 1, None, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        set_receive_timeout(sock, 1e-3)
        run(sock.fileno(), link, fleet, 0.0)
        send_states(sock.fileno(), link, fleet, False)
    time_s(0, config.step_us)

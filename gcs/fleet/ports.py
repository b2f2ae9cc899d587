"""Ports of a fleet: its scenario's, checked, or free ones."""

from collections.abc import Callable
from typing import TypeVar

from gcs.console.errors import BadInput, PortInUse
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, bind_udp, free_ports

T = TypeVar("T")

_TRIES = 5


def on_free_ports(scenario: Scenario, work: Callable[[Scenario, UdpAddress], T]) -> T:
    """Call `work` with free UDP ports, and again if another program takes one meanwhile.

    Args:
        scenario: On any ports.
        work: Called with the scenario on free ports of its host, and with an address for a hub.

    Raises:
        BadInput: The host is not this machine, or ports were taken on every attempt.
    """
    ids = [uav.id for uav in scenario.uavs]
    host = scenario.links.host
    tries = _TRIES
    while True:
        try:
            hub, gcs, plant, *formation = free_ports(4 + max(ids) - min(ids), host)
        except EndpointError as problem:
            raise BadInput(str(problem)) from None
        ports = {
            "gcs_port": gcs,
            "plant_port": plant,
            "formation_base_port": formation[0] - min(ids),
        }
        links = scenario.links.model_copy(update=ports)
        try:
            return work(scenario.model_copy(update={"links": links}), UdpAddress(host, hub))
        except PortInUse:
            tries -= 1
            if not tries:
                raise


def check_ports(scenario: Scenario, hub: UdpAddress | None = None) -> None:
    """Check that every port is free before any process starts.

    Args:
        scenario: The scenario.
        hub: Address for a hub; the GCS port is then not bound.

    Raises:
        BadInput: A port is in use, or the host is not this machine.
    """
    links = scenario.links
    ports = {
        "links.plant_port of the scenario": links.plant_port,
        **{
            f"links.formation_base_port + {uav.id} of the scenario": (
                links.formation_base_port + uav.id
            )
            for uav in scenario.uavs
        },
    }
    if hub is None:
        ports = {"links.gcs_port of the scenario": links.gcs_port, **ports}
    elif hub.port in {links.gcs_port, *ports.values()}:
        raise BadInput(f"--hub-port is {hub.port}, which the scenario already uses")
    else:
        ports = {"--hub-port": hub.port, **ports}
    for what, port in ports.items():
        try:
            address = UdpAddress(links.host, port)
            bind_udp(address, what, "let --free-ports choose others").close()
        except EndpointError as problem:
            raise BadInput(str(problem)) from None

"""The relays between the processes of a flight, as its scenario asks for them."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

from ftc_autopilot.config import AutopilotConfig
from gcs.scenario.model import Scenario
from gcs.scenario.sections import Links
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.capture.relay import Relay, Route
from mavlink_defs.endpoint import UdpAddress

Gate: TypeAlias = Callable[[str, str, bytes], bool]


def relay_of(scenario: Scenario, gate: Gate | None = None) -> Relay:
    """Return the relay for a scenario's `links.impairments`; without them, one with no routes.

    The plant link is relayed along with any other link, since it carries the simulated time.

    Args:
        scenario: The scenario.
        gate: As of `Relay`; with one, the plant link is relayed in any case.
    """
    links = scenario.links
    impairments = links.impairments
    if impairments is None and gate is None:
        return Relay([])
    routes = [_route(links, "plant", links.plant_port, impairments.plant if impairments else None)]
    if impairments is not None and impairments.gcs is not None:
        routes.append(_route(links, "gcs", links.gcs_port, impairments.gcs))
    if impairments is not None and impairments.formation is not None:
        ports = (links.formation_base_port + uav.id for uav in scenario.uavs)
        routes += [_route(links, "formation", port, impairments.formation) for port in ports]
    return Relay(routes, simulated=True, gate=gate)


def through(config: AutopilotConfig, via: Mapping[str, str]) -> AutopilotConfig:
    """Return the configuration with addresses replaced by relays' addresses, as in `Relay.via`."""
    neighbours = (
        n.model_copy(update={"address": via.get(n.address, n.address)}) for n in config.neighbours
    )
    update = {
        "plant": via.get(config.plant, config.plant),
        "gcs": tuple(via.get(address, address) for address in config.gcs),
        "neighbours": tuple(neighbours),
    }
    return config.model_copy(update=update)


def _route(links: Links, link: str, port: int, impairment: Impairment | None) -> Route:
    return Route(link, UdpAddress(links.host, 0), UdpAddress(links.host, port), impairment)

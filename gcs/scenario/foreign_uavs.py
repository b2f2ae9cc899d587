"""A fleet without the UAVs of foreign autopilots, which tell nobody anything."""

from collections.abc import Collection

from ftc_autopilot.guidance.formation import Formation
from gcs.scenario.sections import Network


def network_without(network: Network, foreign: Collection[int]) -> Network:
    """Return the communication graph without some UAVs."""
    if not foreign:
        return network
    access = {i: h for i, h in network.leader_access.items() if i not in foreign}
    edges = tuple(edge for edge in network.edges if not set(foreign) & set(edge.between))
    return network.model_copy(update={"leader_access": access, "edges": edges})


def formation_without(formation: Formation | None, foreign: Collection[int]) -> Formation | None:
    """Return the formation without some UAVs; None if none is left."""
    if formation is None or not foreign:
        return formation
    slots = {i: slot for i, slot in formation.slots.items() if i not in foreign}
    return formation.model_copy(update={"slots": slots}) if slots else None

"""The hub of ``gcs up``: lets any number of ground stations talk to the same vehicles.

A ground station that binds the GCS port has it for itself. The hub has a port of its own:
vehicles send there as well, and whoever speaks to it gets what they send. No socket and no
clock: datagrams and the time go in, addresses to pass them on to come out.
"""

from collections.abc import Collection
from ipaddress import ip_address
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.frames import parse
from mavlink_defs.signing import Signer

__all__ = ["PATIENCE_S", "Hub"]

PATIENCE_S = 5.0
"""How long a ground station is served after it was heard last; they send heartbeats."""

_Peer: TypeAlias = tuple[str, int]
_MIN_FRAME = 12


class Hub:
    """Passes datagrams on between the vehicles of one fleet and its ground stations."""

    def __init__(self, systems: Collection[int], signer: Signer | None = None) -> None:
        """Make a hub.

        Args:
            systems: System ids of the vehicles.
            signer: Checks what comes from either side; frames are passed on as they are.
        """
        self._systems = frozenset(systems)
        self._signer = signer
        self._vehicles: dict[int, _Peer] = {}
        self._stations: dict[_Peer, float] = {}  # when each was heard last

    def route(self, datagram: bytes, sender: _Peer, now: float) -> list[_Peer]:
        """Give the addresses that a datagram is to be sent on to."""
        if self._signer is not None and not self._signer.accepts(datagram):
            return []
        if self._is_of_vehicle(datagram):
            if self._vehicles.get(datagram[5]) != sender:
                if parse(datagram) is None:
                    return []
                self._vehicles[datagram[5]] = sender
            alive = {peer: at for peer, at in self._stations.items() if now - at <= PATIENCE_S}
            self._stations = alive
            return list(alive)
        message = parse(datagram)
        if message is None:
            return []
        self._stations[sender] = now
        target = getattr(message, "target_system", 0)
        if isinstance(message, dialect.MAVLink_setup_signing_message):
            if self._signer is None and not ip_address(sender[0]).is_loopback:
                return []  # to the vehicle it would seem to come from this machine
            if target == 0:
                return []  # a key is for one
        if target == 0:
            return list(self._vehicles.values())
        return [self._vehicles[target]] if target in self._vehicles else []

    def _is_of_vehicle(self, datagram: bytes) -> bool:
        """Look at the header only: most of what passes is telemetry from where it came before."""
        return (
            len(datagram) >= _MIN_FRAME
            and datagram[0] == dialect.PROTOCOL_MARKER_V2
            and datagram[5] in self._systems
            and datagram[6] == dialect.MAV_COMP_ID_AUTOPILOT1
        )

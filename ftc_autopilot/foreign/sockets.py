"""The sockets of the bridge of a foreign autopilot."""

import contextlib
import os
import socket
import sys

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.by_hand import waiting
from mavlink_defs import endpoint
from mavlink_defs.constants import MAX_DATAGRAM
from mavlink_defs.endpoint import UdpAddress

_LOOPBACK = "127.0.0.1"


class BridgeSockets:
    """Its four sockets, of which only the plant's blocks.

    Attributes:
        plant: To the plant.
        gcs: To ground stations.
        stations: Where these are.
        is_by_hand: Whether the autopilot is started by hand.
        mavlink: Where the autopilot's MAVLink is to come to.
        side: That comes there.
        formation: What members of its formation say comes there.
    """

    def __init__(self, config: AutopilotConfig, sockets: contextlib.ExitStack) -> None:
        """Open them.

        Args:
            config: Of the bridge.
            sockets: Closes them.

        Raises:
            EndpointError: One cannot be opened.
        """
        self.plant = sockets.enter_context(
            endpoint.connect_udp(endpoint.parse_address(config.plant))
        )
        stations = [endpoint.resolve(endpoint.parse_address(text)) for text in config.gcs]
        self.stations = [(one.host, one.port) for one in stations]
        self.gcs = sockets.enter_context(endpoint.open_udp(stations))
        by_hand = waiting(config)
        self.is_by_hand = by_hand is not None
        own = UdpAddress(_own_loopback(), 0) if by_hand is None else by_hand.mavlink
        hint = "choose others with autopilot.port"
        self.side = sockets.enter_context(
            endpoint.bind_udp(own, f"MAVLink of UAV {config.id}", hint)
        )
        self.mavlink = UdpAddress(own.host, self.side.getsockname()[1])
        at = endpoint.parse_address(config.formation_bind)
        self.formation = sockets.enter_context(endpoint.bind_udp(at, "formation link"))
        for sock in (self.gcs, self.side, self.formation):
            sock.setblocking(False)

    def to_plant(self, frame: bytes) -> None:
        """Send the plant a frame; it asks again for what it needs."""
        with contextlib.suppress(OSError):
            self.plant.send(frame)

    def to_autopilot(self, frame: bytes, at: tuple[str, int]) -> None:
        """Send the autopilot a frame."""
        _post(self.side, frame, at)

    def to_stations(self, frame: bytes) -> None:
        """Send each ground station a frame."""
        for station in self.stations:
            _post(self.gcs, frame, station)


def _own_loopback() -> str:
    """Return an address of this machine that no other process has.

    The first to send to the port is taken for the autopilot: it is not to be one that still sends
    to whoever had that port before, at the address that all have.
    """
    pid = os.getpid()
    alone = sys.platform == "linux"  # elsewhere the machine has one, unless it is given more
    return f"127.{1 + (pid >> 16)}.{pid >> 8 & 255}.{pid & 255}" if alone else _LOOPBACK


def _post(sock: socket.socket, frame: bytes, to: tuple[str, int]) -> None:
    with contextlib.suppress(OSError):  # the microservices repeat what is lost
        sock.sendto(frame, to)


def waiting_in(sock: socket.socket) -> list[tuple[bytes, tuple[str, int]]]:
    """Return the datagrams that wait in a socket, and where each came from; not without end."""
    found = []
    for _ in range(64):
        try:
            found.append(sock.recvfrom(MAX_DATAGRAM))
        except OSError:
            break
    return found

"""UDP addresses as libc's struct sockaddr_in, for compiled code."""

import socket
import struct

import numpy as np

from mavlink_defs.endpoint import BSD_LIKE, UdpAddress, resolve


def sockaddr(address: UdpAddress) -> np.ndarray:
    """Return the resolved address as a struct sockaddr_in for `native.send_to`, uint8, shape (16,).

    Raises:
        EndpointError: The host's name cannot be resolved.
    """
    family = (
        struct.pack("BB", 16, socket.AF_INET) if BSD_LIKE else struct.pack("=H", socket.AF_INET)
    )
    raw = (
        family
        + struct.pack("!H", address.port)
        + socket.inet_aton(resolve(address).host)
        + bytes(8)
    )
    return np.frombuffer(raw, np.uint8).copy()


def address_of(raw: np.ndarray) -> UdpAddress:
    """Return the address in a struct sockaddr_in, as `native.receive_from` leaves it."""
    (port,) = struct.unpack("!H", raw[2:4].tobytes())
    return UdpAddress(socket.inet_ntoa(raw[4:8].tobytes()), port)

"""TCP addresses that commands listen at: of ``gcs web`` and ``gcs up --foxglove``."""

import errno
import socket

from gcs.console.errors import BadInput
from gcs.console.lines import print_line
from mavlink_defs.endpoint import EndpointError, UdpAddress, is_loopback, parse_address


def listening_address(option: str, text: str) -> UdpAddress:
    """Read an address; warn on standard error if other machines can connect there.

    Args:
        option: Whose value it is, for the message.
        text: HOST:PORT.

    Raises:
        BadInput: It is no address.
    """
    try:
        address = parse_address(text)
        if not is_loopback(address):
            print_line(
                f"warning: {address} can be reached from other machines, without a password and "
                "unencrypted",
                stderr=True,
            )
    except EndpointError as problem:
        raise BadInput(f"{option}: {problem}") from problem
    return address


def listen(option: str, address: UdpAddress) -> socket.socket:
    """Return a socket that listens at an address.

    Raises:
        BadInput: It cannot be had; the option is named.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((address.host, address.port))
        listening.listen()
    except OSError as problem:
        listening.close()
        if problem.errno == errno.EADDRINUSE:
            raise BadInput(
                f"{option}: port {address.port} of {address.host} is in use",
                f"choose another one, as in {option} {address.host}:{address.port % 65535 + 1}",
            ) from None
        raise BadInput(f"{option}: cannot bind {address}: {problem.strerror}") from None
    return listening

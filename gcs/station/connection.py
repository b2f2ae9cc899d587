"""The connection and the system id that commands and the dashboard use."""

import contextlib
import os

from gcs.console.errors import BadInput
from gcs.console.lines import print_line
from mavlink_defs import endpoint
from mavlink_defs.ports import GCS_PORT, HUB_PORT
from mavlink_defs.services.machine import SystemId

_HOST = "127.0.0.1"
_SYSTEM = 255
_FIRST_COMPONENT, _COMPONENTS = 25, 75  # MAV_COMP_ID_USER1 to USER75


def choose_connection(connect: str | None, signing_key: str | None = None) -> endpoint.Connection:
    """Return the user's connection, else the hub of ``gcs up`` if it runs, else the GCS port.

    Args:
        connect: The user's ``--connect``; None without one.
        signing_key: Key file of the connection; it decides the warning about a port that other
            machines can reach.

    Raises:
        BadInput: `connect` is not a connection.
    """
    if connect is not None:
        try:
            connection = endpoint.parse_connection(connect)
        except endpoint.EndpointError as problem:
            raise BadInput(f"--connect: {problem}") from problem
        if connection.direction == "in":
            warn_if_exposed(connection.address, signing_key is not None)
        return connection
    hub = endpoint.UdpAddress(_HOST, HUB_PORT)
    if endpoint.someone_listens(hub):
        return endpoint.Connection("out", hub)
    return endpoint.Connection("in", endpoint.UdpAddress(_HOST, GCS_PORT))


def own_identity() -> SystemId:
    """Return the system and component id of this process.

    Several processes may talk to a vehicle at the same time or in quick succession; the component
    id, derived from the process id, distinguishes their answers.
    """
    return SystemId(_SYSTEM, _FIRST_COMPONENT + os.getpid() % _COMPONENTS)


def warn_if_exposed(address: endpoint.UdpAddress, with_key: bool) -> None:
    """Warn on standard error if a port to be bound can be reached from other machines."""
    with contextlib.suppress(endpoint.EndpointError):  # binding it will report the error
        if not endpoint.is_loopback(address):
            print_line(endpoint.exposed(address, with_key), stderr=True)

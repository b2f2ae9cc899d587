"""Where commands and dashboard meet the vehicles, and as whom."""

import os

from gcs.errors import BadInput
from gcs.station.signing_key import warn_if_exposed
from mavlink_defs.constants import GCS_PORT, HUB_PORT
from mavlink_defs.endpoint import (
    Connection,
    EndpointError,
    UdpAddress,
    parse_connection,
    someone_listens,
)
from mavlink_defs.services.machine import SystemId

__all__ = ["choose_connection", "own_identity"]

_HOST = "127.0.0.1"
_SYSTEM = 255
_FIRST_COMPONENT, _COMPONENTS = 25, 75  # MAV_COMP_ID_USER1 to USER75


def choose_connection(wanted: str | None, signing_key: str | None = None) -> Connection:
    """Return the user's; else that of the hub of ``gcs up`` if there is one, else of the GCS port.

    Args:
        wanted: What the user asked for; None: nothing.
        signing_key: Key file that the connection is used with; a port that can be reached from
            other machines is warned of in another way without one.

    Raises:
        BadInput: It is no connection.
    """
    if wanted is not None:
        try:
            connection = parse_connection(wanted)
        except EndpointError as problem:
            raise BadInput(f"--connect: {problem}") from problem
        if connection.direction == "in":
            warn_if_exposed(connection.address, signing_key is not None)
        return connection
    hub = UdpAddress(_HOST, HUB_PORT)
    if someone_listens(hub):
        return Connection("out", hub)
    return Connection("in", UdpAddress(_HOST, GCS_PORT))


def own_identity() -> SystemId:
    """System and component id of this process.

    Several may talk to a vehicle at a time or shortly one after the other. The id tells its
    answers apart.
    """
    return SystemId(_SYSTEM, _FIRST_COMPONENT + os.getpid() % _COMPONENTS)

"""A ground station for programs: vehicles, faults, missions, subscriptions, all by MAVLink."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection, Iterator, Mapping
from pathlib import Path

from gcs.console.errors import python_errors
from gcs.station.client import Client
from gcs.station.connection import choose_connection, own_identity
from gcs.station.notifications import Notification
from gcs.station.subscriptions import Subscription
from gcs.station.vehicle import Vehicle
from mavlink_defs.dialect import MAVLink_message

__all__ = ["Station", "Subscription", "Uav", "connect"]

Uav = Vehicle
"""One vehicle of a fleet."""


class Station(Mapping[int, Vehicle]):
    """A ground station that is connected to a fleet: its vehicles by system id.

    Attributes:
        client: The client behind it.
    """

    def __init__(self, client: Client) -> None:
        self.client = client

    def __getitem__(self, system: int) -> Vehicle:
        return self.client.vehicle(system)

    def __iter__(self) -> Iterator[int]:
        return iter(self.client.vehicles)

    def __len__(self) -> int:
        return len(self.client.vehicles)

    def __repr__(self) -> str:
        return f"<station on {self.client.connection} with UAV {', '.join(map(str, self))}>"

    async def start(self) -> None:
        """Start the missions of all vehicles, and arm them: simulated time begins."""
        await asyncio.gather(*(uav.start_mission() for uav in self.values()))
        await asyncio.gather(*(uav.arm() for uav in self.values()))

    def messages(
        self, name: str | None = None, *, uav: int | None = None
    ) -> Subscription[MAVLink_message]:
        """Subscribe to messages.

        Args:
            name: Of the message, such as "ATTITUDE"; None for all.
            uav: System id of the sender; None for all.
        """

        def is_of_interest(message: MAVLink_message) -> bool:
            return name in {None, message.get_type()} and uav in {None, message.get_srcSystem()}

        return self.client.received.subscribe(is_of_interest)

    def notifications(self) -> Subscription[Notification]:
        """Subscribe to the event log: changes of mode, texts, answers, faults, lost links."""
        return self.client.notified.subscribe(lambda _: True)


@contextlib.asynccontextmanager
async def connect(
    address: str | None = None,
    *,
    uavs: Collection[int] | None = None,
    timeout_s: float = 5.0,
    signing_key: Path | str | None = None,
) -> AsyncIterator[Station]:
    """Connect to a running fleet, as the commands of `gcs` do.

    As in::

        async with connect() as fleet:
            await fleet.start()
            await fleet[3].set_fault("rudder", effectiveness=0.5)
            async for message in fleet[3].messages("ATTITUDE"):
                print(message.roll)

    Args:
        address: ``udpin:HOST:PORT`` or ``udpout:HOST:PORT``; None for the hub of `gcs up` if there
            is one, else the port of ground stations.
        uavs: System ids to wait for; None for the whole fleet of whoever is heard.
        timeout_s: How long to wait for them [s].
        signing_key: Key file; with one, unsigned frames are refused.

    Yields:
        The station; every vehicle that was waited for has been heard.

    Raises:
        BadInput: The address, the port or the key cannot be used.
        NoAnswer: No vehicle was heard, or not all.
    """
    key = None if signing_key is None else str(signing_key)
    with python_errors():
        client = Client(
            choose_connection(address, key),
            inquire=True,
            private=True,
            own=own_identity(),
            signing_key=key,
        )
        async with client:
            await client.discover(timeout_s, uavs)
            yield Station(client)

"""The sockets of the hub: what one station sends takes no room that others need."""

import asyncio
import contextlib
import socket

from gcs.fleet.hub import Hub
from gcs.fleet.hub_socket import HubSocket
from mavlink_defs import dialect
from mavlink_defs.endpoint import UdpAddress, bind_udp
from mavlink_defs.framing.frames import FramePacker

FLOOD = 20_000  # datagrams, many more than a buffer holds
TIMEOUT_S = 20.0


async def heard(vehicle: socket.socket, frame: bytes) -> None:
    """Wait until a vehicle receives a frame."""
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(TIMEOUT_S):
        while await loop.sock_recv(vehicle, 2048) != frame:
            pass


async def one_floods_and_another_asks() -> None:
    with contextlib.ExitStack() as sockets:
        hub, vehicle, *stations = (
            sockets.enter_context(bind_udp(UdpAddress("127.0.0.1", 0), name))
            for name in ("hub", "vehicle", "flooder", "other")
        )
        for peer in (vehicle, *stations):
            peer.setblocking(False)
            peer.connect(hub.getsockname())
        served = HubSocket(hub, Hub([1]))
        sockets.callback(served.close)
        vehicle.send(FramePacker(1, 1).pack(dialect.MAVLink_system_time_message(0, 0)))
        frames = [FramePacker(200 + k, 190).pack(ping(k)) for k in range(2)]
        for station, frame in zip(stations, frames, strict=True):
            station.send(frame)
            await heard(vehicle, frame)
        await asyncio.sleep(0)  # the hub is done with it
        for _ in range(FLOOD):
            stations[0].send(frames[0])
        stations[1].send(frames[1])
        await heard(vehicle, frames[1])


def ping(k: int) -> dialect.MAVLink_ping_message:
    return dialect.MAVLink_ping_message(k, k, 1, 1)


def test_a_flood_fills_no_buffer_but_its_own() -> None:
    asyncio.run(one_floods_and_another_asks())

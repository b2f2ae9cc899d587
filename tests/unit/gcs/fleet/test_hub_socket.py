"""The sockets of the hub: what one station sends takes no room that others need."""

import asyncio
import contextlib
import os
import socket
import sys
from asyncio.subprocess import PIPE

from gcs.fleet.hub import Hub
from gcs.fleet.hub_socket import HubSocket
from mavlink_defs import dialect
from mavlink_defs.endpoint import UdpAddress, bind_udp
from mavlink_defs.framing.frames import FramePacker

FLOOD = 20_000  # datagrams, many more than a buffer holds
TIMEOUT_S = 300.0


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


GREETING = """
import sys
from pymavlink import mavutil
link = mavutil.mavlink_connection(sys.argv[1], source_system=249)
assert link.WIRE_PROTOCOL_VERSION == "1.0"
while not link.wait_heartbeat(timeout=0.2):
    link.mav.heartbeat_send(6, 8, 0, 0, 4)
print(link.target_system, link.WIRE_PROTOCOL_VERSION)
"""


async def pymavlink_greets() -> tuple[bytes, list[str]]:
    """Let pymavlink, as it is without MAVLINK20, greet a hub with one vehicle."""
    with contextlib.ExitStack() as sockets:
        sock, vehicle = (
            sockets.enter_context(bind_udp(UdpAddress("127.0.0.1", 0), name))
            for name in ("hub", "vehicle")
        )
        hub, packer, address = Hub([7]), FramePacker(7, 1), sock.getsockname()
        served = HubSocket(sock, hub)
        sockets.callback(served.close)
        command = (sys.executable, "-c", GREETING, f"udpout:127.0.0.1:{address[1]}")
        plain = {name: value for name, value in os.environ.items() if name != "MAVLINK20"}
        station = await asyncio.create_subprocess_exec(*command, stdout=PIPE, env=plain)
        said = asyncio.ensure_future(station.communicate())
        async with asyncio.timeout(TIMEOUT_S):
            while not said.done():
                beat = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
                vehicle.sendto(packer.pack(beat), address)
                await asyncio.wait([said], timeout=0.05)
        return said.result()[0], [host for host, _ in hub.old_speakers]


def test_pymavlink_hears_the_hub_without_being_told_of_mavlink_2() -> None:
    assert asyncio.run(pymavlink_greets()) == (b"7 2.0\n", ["127.0.0.1"])


def ping(k: int) -> dialect.MAVLink_ping_message:
    return dialect.MAVLink_ping_message(k, k, 1, 1)


def test_a_flood_fills_no_buffer_but_its_own() -> None:
    asyncio.run(one_floods_and_another_asks())

"""A fleet that flies until it is stopped, and its hub."""

import asyncio
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gcs.errors import BadInput, FlightLost, bad_endpoint
from gcs.fleet.flight import prepare
from gcs.fleet.hub import Hub
from gcs.fleet.processes import FleetProcesses
from gcs.fleet.relays import relay_of
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from mavlink_defs.endpoint import Connection, EndpointError, UdpAddress, bind_udp
from mavlink_defs.framing.key_file import load_signer
from mavlink_defs.framing.signing import SigningError, words_of

__all__ = ["keep_up"]

_LOOK_S = 0.1


async def keep_up(
    scenario: Scenario,
    folder: Path,
    hub: UdpAddress,
    *,
    speed: float | None,
    start: bool,
    restart: bool,
    on_ready: Callable[[], None],
    on_message: Callable[[str], None],
) -> None:
    """Start a fleet, upload profile and faults, and keep it running until this task is cancelled.

    Args:
        scenario: The scenario; its duration does not matter.
        folder: Run folder, exists; gets `processes/`.
        hub: Address to which any number of ground stations can connect.
        speed: Real-time factor; None for lockstep, as fast as the machine allows.
        start: Start the mission and arm, too.
        restart: Start autopilots that fail again; they take up what they kept.
        on_ready: Called when the fleet is up.
        on_message: Called with later messages to the user.

    Raises:
        BadInput: A port is in use.
        FlightLost: The plant ended, because an aircraft was lost or otherwise.
        CommandRefused: A vehicle refused its profile, a fault, its mission or arming.
        NoAnswer: A vehicle did not appear or did not answer.
    """
    key = scenario.links.signing_key
    try:
        signer = load_signer(key)
        sock = bind_udp(hub, "hub", "choose another one with --hub-port")
    except SigningError as problem:
        raise BadInput(str(problem)) from problem
    except EndpointError as problem:
        raise bad_endpoint(problem) from problem
    sock.setblocking(False)
    loop = asyncio.get_running_loop()
    ids = [uav.id for uav in scenario.uavs]
    route = Hub(ids, signer, sock.getsockname()[0])
    transport, _ = await loop.create_datagram_endpoint(lambda: _HubProtocol(route), sock=sock)
    try:
        processes = folder / "processes"
        with (
            relay_of(scenario) as relay,
            FleetProcesses(
                scenario,
                speed,
                processes,
                endless=True,
                restart=restart,
                ground_stations=[hub],
                via=relay.via,
            ) as fleet,
        ):
            async with Client(Connection("out", hub), signing_key=key) as client:
                await prepare(client, fleet, scenario, start)
            on_ready()
            ended: set[int] = set()
            told: set[str] = set()
            while True:
                await asyncio.sleep(_LOOK_S)
                if restart:
                    fleet.check()
                for words in fleet.newly_restarted():
                    on_message(words)
                for name, words in fleet.newly_ended():
                    if name == "plant":
                        raise FlightLost(words)
                    ended.add(int(name.removeprefix("uav")))
                    again = shlex.join(["ftc-autopilot", f"{processes / name}.yaml"])
                    on_message(
                        f"{name}: {words}; the others fly on, its aircraft with the last command. "
                        f"`{again}` starts it again, disarmed and without a profile"
                    )
                for system in sorted(ended & set(route.moved)):
                    ended.remove(system)
                    on_message(
                        f"uav{system} is back, disarmed and without a profile: "
                        f"`gcs profile upload FILE --uav {system}`, `gcs start --uav {system}`, "
                        f"`gcs arm --uav {system}`"
                    )
                route.moved.clear()
                if route.drops.keys() - told:
                    told |= route.drops.keys()
                    on_message(f"hub: dropped {words_of(route.drops)}")
    finally:
        transport.close()
        if route.drops:
            on_message(f"hub: dropped {words_of(route.drops)} in all")


class _HubProtocol(asyncio.DatagramProtocol):
    """The hub's socket."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        now = asyncio.get_running_loop().time()
        for peer in self._hub.route(data, addr, now):
            self._transport.sendto(data, peer)

"""A fleet that flies until it is stopped, and its hub."""

import asyncio
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from gcs.console.errors import BadInput, FlightLost, bad_endpoint
from gcs.fleet.hub import Hub
from gcs.fleet.hub_socket import HubSocket
from gcs.fleet.observer import Observer
from gcs.fleet.processes import FleetProcesses
from gcs.fleet.standing_record import StandingRecord
from gcs.fleet.start import prepare
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from mavlink_defs.endpoint import Connection, EndpointError, UdpAddress, bind_udp
from mavlink_defs.framing.key_file import load_signer
from mavlink_defs.framing.signing import SigningError, counts_text
from mavlink_defs.runtime.heap import give_memory_back

_POLL_S = 0.1
_END_OF_PLANT_S = 1.0


async def keep_up(
    scenario: Scenario,
    folder: Path,
    hub: UdpAddress,
    *,
    speed: float | None,
    start: bool,
    restart: bool,
    record: bool = True,
    autopilot_processes: int | None = None,
    on_ready: Callable[[], Sequence[Observer]],
    on_message: Callable[[str], None],
    on_start: Callable[[str], None] = lambda _: None,
) -> None:
    """Start a fleet, upload profile and faults, and keep it running until this task is cancelled.

    Args:
        scenario: The scenario; its duration does not matter.
        folder: Run folder, exists; gets `processes/`, and what `StandingRecord` writes.
        hub: Address to which any number of ground stations can connect.
        speed: Real-time factor; None for lockstep, as fast as the machine allows.
        start: Start the mission and arm, too.
        restart: Start autopilots that fail again; they resume from their checkpoints.
        record: Keep a log and a light recording.
        autopilot_processes: As of `FleetProcesses`.
        on_ready: Called when the fleet is up; returns who else watches it, until its end.
        on_message: Called with later messages to the user, from any thread.
        on_start: Called with how far the start is.

    Raises:
        BadInput: A port is in use.
        FlightLost: The plant ended, because an aircraft was lost or otherwise.
        CommandRefused: A vehicle refused its profile, a fault, its mission or arming.
        NoAnswer: A vehicle did not appear or did not answer.
        OSError: A file of the run folder cannot be written at the start; it is named.
    """
    key = scenario.links.signing_key
    try:
        signer = load_signer(key)
        sock = bind_udp(hub, "hub", "choose another one with --hub-port")
    except SigningError as problem:
        raise BadInput(str(problem)) from problem
    except EndpointError as problem:
        raise bad_endpoint(problem) from problem
    ids = [uav.id for uav in scenario.uavs]
    recording = StandingRecord(scenario, folder, on_message) if record else None
    log = (lambda _: None) if recording is None else recording.log
    route = Hub(ids, signer, sock.getsockname()[0], log)
    served = HubSocket(sock, route, on_message)
    observers = []
    if recording is not None:
        observers.append(Observer("recording", recording.watch, on_message))
    try:
        processes = folder / "processes"
        with FleetProcesses(
            scenario,
            speed,
            processes,
            endless=True,
            record=record,
            restart=restart,
            autopilot_processes=autopilot_processes,
            ground_stations=[hub],
        ) as fleet:
            async with Client(Connection("out", hub), signing_key=key) as client:
                await prepare(client, fleet, scenario, start, on_start, on_message)
            observers += on_ready()
            give_memory_back()
            await _watch(fleet, route, observers, processes, restart, on_message)
    finally:
        served.close()
        for observer in observers:
            observer.close()
        if route.drops:
            on_message(f"hub: dropped {counts_text(route.drops)} in all")


async def _watch(
    fleet: FleetProcesses,
    hub: Hub,
    observers: Sequence[Observer],
    folder: Path,
    restart: bool,
    on_message: Callable[[str], None],
) -> None:
    """Supervise and report, until this task is cancelled; arguments as of `keep_up`."""
    ended: set[int] = set()
    reported: set[str] = set()
    while True:
        await asyncio.sleep(_POLL_S)
        for observer in observers:
            observer.check()
        if restart:
            fleet.check()
        for text in fleet.newly_restarted():
            on_message(text)
        for name, text in await _newly_ended(fleet):
            ended.add(int(name.removeprefix("uav")))
            again = shlex.join(["ftc-autopilot", f"{folder / name}.yaml"])
            on_message(
                f"{name}: {text}; the others fly on, its aircraft with the last command. "
                f"`{again}` starts it again, disarmed and without a profile"
            )
        for system in sorted(ended & set(hub.moved)):
            ended.remove(system)
            on_message(
                f"uav{system} is back, disarmed and without a profile: "
                f"`gcs profile upload FILE --uav {system}`, `gcs start --uav {system}`, "
                f"`gcs arm --uav {system}`"
            )
        hub.moved.clear()
        for host, port in hub.old_speakers:
            on_message(
                f"station at {host}:{port} speaks MAVLink 1: it is answered in MAVLink 2, and "
                "vehicles hear it from when it speaks that, as pymavlink does with MAVLINK20=1"
            )
        hub.old_speakers.clear()
        if hub.drops.keys() - reported:
            reported |= hub.drops.keys()
            on_message(f"hub: dropped {counts_text(hub.drops)}")


async def _newly_ended(fleet: FleetProcesses) -> list[tuple[str, str]]:
    """Return the autopilots that have ended without the others, with the reason.

    Autopilots end when the plant does: a moment is waited, so that the cause is reported, and not
    what follows from it.

    Raises:
        FlightLost: The plant has ended, or a process of several autopilots, for which it waits.
    """
    over = fleet.newly_ended()
    if over:
        await asyncio.sleep(_END_OF_PLANT_S)
        over += fleet.newly_ended()
    for name, text in sorted(over, key=lambda one: one[0] != "plant"):  # the cause first
        if name == "plant" or "-" in name:
            raise FlightLost(f"{name}: {text}")
    return over

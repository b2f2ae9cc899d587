"""Flying a scenario with real processes, as an operator would: all by MAVLink.

Upload the mission to every vehicle, set the faults, start the missions, arm. When the last
vehicle is armed simulated time begins; when the plant ends, the flight is over.
"""

import asyncio
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ftc_autopilot.vehicle.telemetry import DEFAULT_INTERVALS_US
from gcs.fleet.collector import Collector
from gcs.fleet.ports import on_free_ports
from gcs.fleet.processes import FleetProcesses
from gcs.fleet.start import prepare
from gcs.results.recording import Ending, Recording, Steps
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.station.patience import ENDLESS
from gcs.station.telemetry import REQUESTED_S
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.config.output_files import write_text
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import Connection, UdpAddress

_POLL_S = 0.05
_END_TIMEOUT_S = 10.0
_FOR_DISPLAYS = {*DEFAULT_INTERVALS_US, *REQUESTED_S} - {
    dialect.MAVLINK_MSG_ID_FTC_EVENTS,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
}
"""Ids of messages that nothing here uses: decoding them takes a third of the time."""


async def fly_over_udp(
    scenario: Scenario,
    folder: Path,
    on_steps: Callable[[Steps], None],
    speed: float | None = None,
    on_progress: Callable[[float, np.ndarray], None] | None = None,
    *,
    restart: bool = False,
    autopilot_processes: int | None = None,
    crashes: Mapping[int, Sequence[int]] = MappingProxyType({}),
    on_start: Callable[[str], None] = lambda _: None,
) -> Ending:
    """Fly a scenario with one plant process and one for each autopilot, or for several.

    Args:
        scenario: The scenario.
        folder: Run folder, exists; gets `flight.tlog`, and `processes/` with the configuration
            and the log of each process; with `links.impairments` also `wire.json`.
        on_steps: Called with the recorded steps, in order; also if the flight ends in an error.
        speed: Real-time factor; None for lockstep, as fast as the machine allows.
        on_progress: Called with the simulated time [s] and the event counts so far, (n, 4).
        restart: Start autopilots that fail again; they resume from their checkpoints.
        autopilot_processes: As of `FleetProcesses`.
        crashes: Steps after which autopilots crash, by UAV, one for each start: for tests.
        on_start: Called with how far the start is.

    Raises:
        BadInput: A port is in use.
        FlightLost: A process ended before simulated time began, or left no recording.
        OSError: A file cannot be written; it is named.
        CommandRefused: A vehicle refused its profile, a fault, its mission or arming.
        NoAnswer: A vehicle did not appear or did not answer.
    """
    events = np.zeros((len(scenario.uavs), 4), np.int64)
    ids = [uav.id for uav in scenario.uavs]

    def follow(message: MAVLink_message) -> None:
        if (
            on_progress is not None
            and isinstance(message, dialect.MAVLink_ftc_events_message)
            and message.get_srcSystem() in ids  # another fleet may send here, too
        ):
            events[ids.index(message.get_srcSystem())] = message.events
            on_progress(message.time_boot_ms / 1e3, events)

    links = scenario.links
    connection = Connection("in", UdpAddress(links.host, links.gcs_port))
    with TlogWriter(folder / "flight.tlog") as tlog:
        async with Client(
            connection,
            tlog=tlog,
            on_message=follow,
            private=True,
            only_recorded=_FOR_DISPLAYS,
            signing_key=links.signing_key,
            patience=ENDLESS,  # the start sees who lives
        ) as client:
            with FleetProcesses(
                scenario,
                speed,
                folder / "processes",
                restart=restart,
                autopilot_processes=autopilot_processes,
                crashes=crashes,
            ) as fleet:
                collector = Collector(scenario, fleet.recording_of)
                try:
                    await prepare(client, fleet, scenario, start=True, on_start=on_start)
                    while fleet.plant_returncode is None:
                        fleet.check()
                        client.check()
                        collector.pass_on(on_steps)
                        await asyncio.sleep(_POLL_S)
                    fleet.check()
                    fleet.wait(_END_TIMEOUT_S)
                    await client.catch_up(_END_TIMEOUT_S)  # with the autopilots' last messages
                finally:
                    fleet.wait(_END_TIMEOUT_S if fleet.plant_returncode is not None else 0.0)
                    collector.pass_on(on_steps, over=True)
                    if links.impairments is not None:
                        report = json.dumps(fleet.relay.report().to_json(), indent=2)
                        write_text(folder / "wire.json", report + "\n")
    fleet.check()
    restarts = tuple(map(fleet.restarts_of, ids))
    return collector.ending("real_time" if speed else "lockstep", restarts)


def fly_and_record(scenario: Scenario, folder: Path, **options: Any) -> Recording:
    """Fly as `fly_over_udp` does, on free ports, and return every step of the flight.

    Args:
        scenario: The scenario.
        folder: As of `fly_over_udp`, which raises the same.
        options: Of `fly_over_udp`.
    """
    ids = tuple(uav.id for uav in scenario.uavs)

    def flown(on_ports: Scenario, _hub: UdpAddress) -> Recording:
        parts = list[Steps]()
        ending = asyncio.run(fly_over_udp(on_ports, folder, parts.append, **options))
        return Recording.of(Steps.joined(parts, len(ids)), ending, ids, scenario.step_us)

    return on_free_ports(scenario, flown)

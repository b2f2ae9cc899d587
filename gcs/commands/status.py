"""``gcs status``: show the vehicles of a running fleet."""

import asyncio
import contextlib
from functools import partial
from typing import Annotated, Any

import typer
from rich.console import Group
from rich.live import Live

from gcs.commands.station import Station, station_command
from gcs.errors import CommandRefused, Interrupted, NoAnswer
from gcs.station.client import Client
from gcs.station.status import drop_lines, fleet_table, vehicle_status
from gcs.station.vehicle import Vehicle
from gcs.terminal import console_of, print_json
from mavlink_defs import dialect

__all__ = ["EPILOG", "status"]

EPILOG = """
Examples:

- gcs status
- gcs status --watch
- gcs status --uav 3 --json | jq '.vehicles[0].channels.rudder.events'
- gcs status --connect udpin:0.0.0.0:14550

Faults are shown as active/all; `old 0.4 s` as link: in the last second or two the autopilot acted
on a state that was that old, in simulated time.
Below the table: what was dropped on the links, if anything.
Exit status: 0 shown, 2 bad input, 4 no vehicle heard;
--watch continues until Ctrl-C (0) or until its output is closed (0).
"""

_ANSWERS_S = 2.0
_FIRST_TELEMETRY_S = 1.0
_REFRESH_S = 1.0
_WANTED = (
    dialect.MAVLINK_MSG_ID_ATTITUDE,
    dialect.MAVLINK_MSG_ID_VFR_HUD,
    dialect.MAVLINK_MSG_ID_FTC_TRACKING,
    dialect.MAVLINK_MSG_ID_FTC_EVENTS,
    dialect.MAVLINK_MSG_ID_FTC_DROPS,
)


@station_command
def status(
    station: Station,
    watch: Annotated[
        bool, typer.Option("--watch", help="Refresh once a second until Ctrl-C.")
    ] = False,
) -> None:
    """Show link, mode, attitude, events, savings and faults of every vehicle."""

    async def once(client: Client, vehicles: list[Vehicle]) -> None:
        await asyncio.gather(*(_ask(client, vehicle) for vehicle in vehicles))
        _show(client, vehicles, station.as_json)

    async def on_and_on(client: Client, vehicles: list[Vehicle]) -> None:
        def chosen() -> list[Vehicle]:
            return vehicles if station.uavs is not None else list(client.vehicles.values())

        console = console_of(stderr=False)
        if station.as_json or not console.is_terminal:
            while True:
                _show(client, chosen(), station.as_json)
                await asyncio.sleep(_REFRESH_S)
        with Live(console=console, auto_refresh=False) as live:
            while True:
                states = [vehicle.state for vehicle in chosen()]
                lines = drop_lines(client.drops, states)
                live.update(Group(fleet_table(states, client.now()), *lines), refresh=True)
                await asyncio.sleep(_REFRESH_S)

    if not watch:
        station.run(once, private=True)
        return
    try:
        station.run(on_and_on, inquire=True, private=True)
    except (Interrupted, BrokenPipeError):  # Ctrl-C, or the reader of the pipe ended
        return


async def _ask(client: Client, vehicle: Vehicle) -> None:
    """Request the faults, profile and drop counts of a vehicle, and await telemetry."""
    drops = partial(vehicle.request, dialect.MAVLINK_MSG_ID_FTC_DROPS)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_ANSWERS_S):  # what it did not tell by then is shown as unknown
            for question in (vehicle.list_faults, vehicle.download, drops):
                with contextlib.suppress(CommandRefused, NoAnswer):
                    await question()
    await client.until(lambda: vehicle.state.latest.keys() >= set(_WANTED), _FIRST_TELEMETRY_S)


def _show(client: Client, vehicles: list[Vehicle], as_json: bool) -> None:
    now = client.now()
    if not as_json:
        console, states = console_of(stderr=False), [vehicle.state for vehicle in vehicles]
        console.print(fleet_table(states, now), *drop_lines(client.drops, states), sep="\n")
        return
    answer: dict[str, Any] = {
        "connection": str(client.connection),
        "saving": client.fleet.saving,
        "drops": client.drops,
        "vehicles": [vehicle_status(vehicle.state, now).to_json() for vehicle in vehicles],
    }
    print_json(answer)

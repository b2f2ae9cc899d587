"""``gcs status``: show the vehicles of a running fleet."""

import asyncio
import contextlib
from functools import partial
from typing import Annotated, Any

import typer
from rich.console import Group
from rich.live import Live

from gcs.commands.station import StationOptions, station_command
from gcs.console.errors import CommandRefused, Interrupted, NoAnswer
from gcs.console.lines import print_json
from gcs.console.terminal import console_of
from gcs.station.client import Client
from gcs.station.status import drop_lines, fleet_table, not_heard, silence_lines, vehicle_status
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect

_ANSWERS_S = 5.0  # a busy machine answers late
_REFRESH_S = 1.0


@station_command
def status(
    station: StationOptions, watch: Annotated[bool, typer.Option("--watch")] = False
) -> None:
    """Show link, mode, attitude, events and faults of each vehicle.

    Args:
        watch: Refresh once a second until Ctrl-C.

    Examples:
        - gcs status
        - gcs status --watch
        - gcs status --uav 3 --json | jq '.vehicles[0].channels.rudder.events'
        - gcs status --connect udpin:0.0.0.0:14550

    Faults are shown as active/all; `old 0.4 s` as link: in the last second or two the autopilot
    acted on a state that was that old, in simulated time. Below the table, if there is anything:
    members of the fleet that were not heard within two seconds, what the others did not report, and
    what was dropped on the links.

    Exit status: 0 shown, 2 bad input, 4 no vehicle heard, or a
    member of the fleet not (without --uav); --watch continues until Ctrl-C (0) or until its output
    is closed (0).
    """
    work = partial(_on_and_on if watch else _once, station)
    try:
        exit_status = station.run(work, inquire=watch, private=True, whole=False)
    except (Interrupted, BrokenPipeError):  # Ctrl-C, or the reader of the pipe ended
        if not watch:
            raise
        return
    raise typer.Exit(exit_status)


def _chosen(client: Client, station: StationOptions) -> list[VehicleState]:
    """Return the vehicles to show: those chosen, or all that have been heard by now."""
    states = [vehicle.state for vehicle in client.vehicles.values()]
    return [s for s in states if station.systems is None or s.system in station.systems]


def _missing(client: Client, station: StationOptions) -> list[int]:
    """Return the members of the fleet that have never been heard, if the fleet is to be shown."""
    if station.systems is not None:
        return []
    return [system for system in client.fleet.missing if system not in client.vehicles]


async def _once(station: StationOptions, client: Client, vehicles: list[Vehicle]) -> int:
    await _ask(client, vehicles, station)
    _show(client, station)
    return NoAnswer.exit_status if _missing(client, station) else 0


async def _on_and_on(station: StationOptions, client: Client, vehicles: list[Vehicle]) -> int:
    await _ask(client, vehicles, station)
    console = console_of(stderr=False)
    if station.as_json or not console.is_terminal:
        while True:
            _show(client, station)
            await asyncio.sleep(_REFRESH_S)
    with Live(console=console, auto_refresh=False) as live:
        while True:
            live.update(_fleet(client, station), refresh=True)
            await asyncio.sleep(_REFRESH_S)


def _show(client: Client, station: StationOptions) -> None:
    if station.as_json:
        print_json(_status(client, station))
    else:
        console_of(stderr=False).print(_fleet(client, station))


async def _ask(client: Client, vehicles: list[Vehicle], station: StationOptions) -> None:
    """Request fleet, faults, profile and drop counts, and await them and telemetry.

    What a vehicle has not reported by then is shown as unknown.
    """

    def complete() -> bool:
        return not _missing(client, station) and not any(map(not_heard, _chosen(client, station)))

    async def ask(vehicle: Vehicle) -> None:
        await vehicle.ask_for_fleet()
        await vehicle.ask_what_is_due()
        with contextlib.suppress(CommandRefused, NoAnswer):
            await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_DROPS)

    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_ANSWERS_S):
            await asyncio.gather(*map(ask, vehicles))
            await client.until(complete, _ANSWERS_S)


def _fleet(client: Client, station: StationOptions) -> Group:
    """Return the table and the lines below it."""
    states = _chosen(client, station)
    lines = [*silence_lines(_missing(client, station), states), *drop_lines(client.drops, states)]
    return Group(fleet_table(states, client.now()), *lines)


def _status(client: Client, station: StationOptions) -> dict[str, Any]:
    """Return the same and more as JSON data."""
    now = client.now()
    return {
        "connection": str(client.connection),
        "saving": client.fleet.saving,
        "drops": client.drops,
        "not_heard": _missing(client, station),
        "vehicles": [vehicle_status(state, now) for state in _chosen(client, station)],
    }

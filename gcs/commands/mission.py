"""``gcs mission show|upload|download|fly``: missions of vehicles and of files."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from gcs.commands import transfer
from gcs.commands.options import JsonOption
from gcs.commands.station import EXIT_STATUS, StationOptions, station_command
from gcs.commands.transfer import Note
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.outputs import check_file
from gcs.console.terminal import console_of, numbers, table_of, texts
from gcs.scenario.itinerary import Itinerary, dry_run, load_mission
from gcs.scenario.mission import tell_not_flown
from gcs.scenario.model import read_scenario
from gcs.station.mission import Mission, is_same, item_text
from gcs.station.vehicle import Vehicle
from mavlink_defs.config.models import counted
from mavlink_defs.mission_files import (
    MISSION_SUFFIXES,
    is_mission_file,
    plan_text,
    waypoints_text,
)

app = typer.Typer(help="Show, upload, download and fly missions.", no_args_is_help=True)

_File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="QGroundControl's plan, a list of waypoints (QGC WPL), or a scenario."
    ),
]

_SHOW_EPILOG = """
Examples:

- gcs mission show survey.plan
- gcs mission show survey.plan --fleet my.yaml --json | jq .time_s

Exit status: 0 it can be flown, 2 the file cannot be used or flown.
"""

_UPLOAD_EPILOG = f"""
Examples:

- gcs mission upload survey.plan
- gcs mission upload my.yaml --uav 1,3 --json
{EXIT_STATUS}"""

_DOWNLOAD_EPILOG = f"""
Examples:

- gcs mission download --uav 1
- gcs mission download --out held.plan
{EXIT_STATUS}"""

_FLY_EPILOG = f"""
Examples:

- gcs mission fly survey.plan
- gcs mission fly survey.plan --uav 2
{EXIT_STATUS}"""


@app.command(epilog=_SHOW_EPILOG)
def show(
    file: _File,
    fleet: Annotated[
        Path | None,
        typer.Option(
            help="Scenario of the fleet that is to fly it; FILE if that is one, "
            "else paper/scenario1.",
            metavar="SCENARIO",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check a mission as a vehicle would, and show its items, lengths, turns and times.

    Times are those in still air, from home on.
    """
    items, not_flown = _read(file)
    own = Path("paper/scenario1") if is_mission_file(file) else file
    itinerary = dry_run(file, items, read_scenario(fleet or own))
    if as_json:
        listed = [{"item": item.seq, "text": item_text(item)} for item in items[1:]]
        print_json(
            {"file": str(file), "items": listed, "not_flown": not_flown, **asdict(itinerary)}
        )
        return
    console_of(stderr=False).print(_table(items, itinerary), _total(itinerary))


@app.command(epilog=_UPLOAD_EPILOG)
@partial(station_command, timeout_s=30.0)
def upload(
    station: StationOptions,
    file: _File,
) -> None:
    """Upload a mission. It takes effect at once; if it is refused, the old one stays active."""
    _send(station, file, start=False)


@app.command(epilog=_FLY_EPILOG)
@partial(station_command, timeout_s=30.0)
def fly(
    station: StationOptions,
    file: _File,
) -> None:
    """Upload a mission, start it, and arm the UAVs that are not armed yet."""
    _send(station, file, start=True)


@app.command(epilog=_DOWNLOAD_EPILOG)
@partial(station_command, timeout_s=30.0)
def download(
    station: StationOptions,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write a .plan or .waypoints file; all vehicles must hold the same mission.",
            metavar="FILE",
        ),
    ] = None,
) -> None:
    """Print the missions of vehicles, or write the one that all hold to a file."""
    if out is not None and out.suffix.lower() not in MISSION_SUFFIXES:
        raise BadInput(f"{out} has neither the suffix .plan nor .waypoints", "choose one of them")
    if out is not None:
        check_file(out)
    held: dict[int, Mission] = {}

    async def action(vehicle: Vehicle) -> str:
        held[vehicle.system] = await vehicle.download_mission()
        lines = [f"UAV {vehicle.system} holds {_count(held[vehicle.system])}"]
        if out is None:
            lines += [f"  {item.seq:3} {item_text(item)}" for item in held[vehicle.system][1:]]
        return "\n".join(lines)

    def data(vehicle: Vehicle) -> dict[str, Any]:
        return {"mission": [_plain(item) for item in held[vehicle.system]]}

    try:
        station.act(action, data)
    finally:
        if out is not None and held:
            transfer.write_held(out, held, "mission", is_same, partial(_text_of, out))


def _send(station: StationOptions, file: Path, start: bool) -> None:
    """Upload a mission, and start it if asked to."""
    items, not_flown = _read(file)
    if start and len(items) < 2:
        raise BadInput(f"{file} has no item to fly", "an upload of it clears a mission")

    async def send(vehicle: Vehicle, note: Note) -> str:
        await vehicle.upload_mission(items, note)
        if not start:
            return f"UAV {vehicle.system} holds {_count(items)} of {file}"
        await vehicle.start_mission()
        if not vehicle.state.armed:
            await vehicle.arm()
        return f"UAV {vehicle.system} flies {_count(items)} of {file}"

    transfer.upload(station, send, {"items": len(items) - 1, "not_flown": not_flown})


def _read(file: Path) -> tuple[Mission, tuple[str, ...]]:
    """Read a mission, and tell what is in its file that nobody flies."""
    items, not_flown = load_mission(file)
    if is_mission_file(file):  # a scenario tells by itself
        tell_not_flown(file, not_flown)
    return items, not_flown


def _text_of(out: Path, mission: Mission) -> str:
    if len(mission) < 2:
        raise BadInput(f"no mission to write to {out}: the vehicles hold none", "upload one first")
    return plan_text(mission) if out.suffix.lower() == ".plan" else waypoints_text(mission)


def _count(mission: Mission) -> str:
    return counted(max(len(mission) - 1, 0), "item")


def _plain(item: Any) -> dict[str, Any]:
    names = ("seq", "frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z")
    return {name: getattr(item, name) for name in names}


def _table(items: Mission, itinerary: Itinerary) -> Table:
    headings = ("north m", "east m", "height m", "V m/s", "way m", "time s", "turn m")
    columns = (numbers(""), texts("item"), *map(numbers, headings))
    table = table_of(*columns, box=None, pad_edge=False)
    reached = {stage.item: stage for stage in reversed(itinerary.stages)}
    for item in items[1:]:
        if (stage := reached.get(item.seq)) is None:
            table.add_row(str(item.seq), item_text(item))
            continue
        values = (
            stage.north_m,
            stage.east_m,
            stage.height_m,
            stage.airspeed_m_s,
            stage.length_m,
            stage.time_s,
            stage.turn_radius_m,
        )
        shown = ("-" if value is None else f"{value:.0f}" for value in values)
        table.add_row(str(item.seq), item_text(item), *shown)
    return table


def _total(itinerary: Itinerary) -> str:
    total = f"{itinerary.length_m:.0f} m, {itinerary.time_s:.0f} s in still air; then "
    if itinerary.repeats is not None:
        return f"{total}again from item {itinerary.repeats} on"
    if itinerary.lands:
        return f"{total}stands"
    return f"{total}circles around the last place"

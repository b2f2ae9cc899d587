"""``gcs mission show|upload|download|fly``: missions of vehicles and of files."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.table import Table
from rich.text import Text

from ftc_autopilot.guidance.mission_places import home_item
from gcs.commands import transfer
from gcs.commands.mission_map import mission_map
from gcs.commands.mission_profile import height_profile
from gcs.commands.options import JsonOption
from gcs.commands.station import StationOptions, station_command
from gcs.commands.transfer import Note
from gcs.console.errors import BadInput, CommandRefused
from gcs.console.lines import print_json, print_line
from gcs.console.outputs import check_file
from gcs.console.terminal import console_of, numbers, table_of, texts
from gcs.scenario.fence import Areas
from gcs.scenario.itinerary import Itinerary, dry_run, dry_run_areas, load_areas, load_mission
from gcs.scenario.mission import tell_not_flown
from gcs.scenario.model import read_scenario
from gcs.scenario.moved_mission import moved_plan
from gcs.station.mission import Mission, is_same, item_text
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.models import counted
from mavlink_defs.mission_files import MISSION_SUFFIXES, is_mission_file, plan_text, waypoints_text

app = typer.Typer(help="Show, upload, download and fly missions.", no_args_is_help=True)

_File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="QGroundControl's plan, a list of waypoints (QGC WPL), or a scenario."
    ),
]

_Here = Annotated[
    bool,
    typer.Option("--here", help="Move the whole mission: its home becomes the one of the flight."),
]


@app.command()
def show(
    file: _File,
    fleet: Annotated[Path | None, typer.Option(metavar="SCENARIO")] = None,
    here: _Here = False,
    as_json: JsonOption = False,
) -> None:
    """Check a mission as a vehicle would, and show its items, lengths, turns, times and heights.

    Times are those in still air, from home on. A map shows fence and rally points, if it has some.

    Args:
        fleet: Scenario of the fleet that is to fly it; FILE if that is one, else paper/scenario1.

    Examples:
        - gcs mission show survey.plan
        - gcs mission show elsewhere.waypoints --here
        - gcs mission show survey.plan --fleet my.yaml --json | jq .time_s

    Exit status: 0 it can be flown, 2 the file cannot be used or flown.
    """
    items, not_flown = _read(file)
    own = Path("paper/scenario1") if is_mission_file(file) else file
    scenario = read_scenario(fleet or own)
    areas = load_areas(file)
    if here:
        items, *around = moved_plan(home_item(scenario.origin), items, areas)
        areas = Areas(*around)
    itinerary = dry_run(file, items, scenario)
    remarks = list(scenario.planner().remarks(items))
    about_areas = list(dry_run_areas(file, areas, items, scenario)) if any(areas) else []
    if as_json:
        listed = [{"item": item.seq, "text": item_text(item)} for item in items[1:]]
        about = {"file": str(file), "items": listed, "not_flown": not_flown}
        about |= {"remarks": remarks, "areas": about_areas}
        print_json({**about, **asdict(itinerary)})
        return
    console = console_of(stderr=False)
    profile = height_profile(itinerary, min(console.width, 100))
    console.print(_table(items, itinerary))
    console.print(profile, markup=False, highlight=False)
    for remark in remarks:
        print_line(remark)
    console.print(_total(itinerary))
    if any(areas):
        drawn = mission_map(items, areas, scenario.origin, min(console.width, 100))
        console.print(Text.from_ansi(drawn), *about_areas, sep="\n")


@app.command()
@partial(station_command, timeout_s=30.0)
def upload(station: StationOptions, file: _File, here: _Here = False) -> None:
    """Upload a mission, and fence and rally points if the file has some.

    Each takes effect at once; if it is refused, the old one stays active. A fence is watched while
    FENCE_ENABLE is 1.

    Examples:
        - gcs mission upload survey.plan
        - gcs mission upload elsewhere.waypoints --here
        - gcs mission upload my.yaml --uav 1,3 --json
    """
    _send(station, file, start=False, here=here)


@app.command()
@partial(station_command, timeout_s=30.0)
def fly(station: StationOptions, file: _File, here: _Here = False) -> None:
    """Upload a mission, start it, and arm the UAVs that are not armed yet.

    Examples:
        - gcs mission fly survey.plan
        - gcs mission fly survey.plan --uav 2
    """
    _send(station, file, start=True, here=here)


@app.command()
@partial(station_command, timeout_s=30.0)
def download(
    station: StationOptions, out: Annotated[Path | None, typer.Option(metavar="FILE")] = None
) -> None:
    """Print what vehicles hold, or write the mission that all hold to a file.

    Fence and rally points go along; a .waypoints file has the mission alone.

    Args:
        out: Write a .plan or .waypoints file; all vehicles must hold the same mission.

    Examples:
        - gcs mission download --uav 1
        - gcs mission download --out held.plan
    """
    if out is not None and out.suffix.lower() not in MISSION_SUFFIXES:
        raise BadInput(f"{out} has neither the suffix .plan nor .waypoints", "choose one of them")
    if out is not None:
        check_file(out)
    held: dict[int, _Held] = {}

    async def action(vehicle: Vehicle) -> str:
        mission, areas = held[vehicle.system] = await _held_by(vehicle)
        lines = [f"UAV {vehicle.system} holds {_counts(mission, areas)}"]
        if out is None:
            lines += [f"  {item.seq:3} {item_text(item)}" for item in mission[1:]]
            for key, items in areas._asdict().items():
                lines += [f"  {key} {item.seq:3} {item_text(item)}" for item in items]
        return "\n".join(lines)

    def data(vehicle: Vehicle) -> dict[str, Any]:
        mission, areas = held[vehicle.system]
        parts = {"mission": mission, **areas._asdict()}
        return {key: [_plain(item) for item in items] for key, items in parts.items()}

    try:
        station.act(action, data)
    finally:
        if out is not None and held:
            transfer.write_held(out, held, "mission", _is_same, partial(_text_of, out))


def _send(station: StationOptions, file: Path, *, start: bool, here: bool) -> None:
    """Upload a mission, moved to each vehicle's home if asked to, and start it if asked to."""
    items, not_flown = _read(file)
    areas = load_areas(file)
    if start and len(items) < 2:
        raise BadInput(f"{file} has no item to fly", "an upload of it clears a mission")

    async def send(vehicle: Vehicle, note: Note) -> str:
        own, around = items, areas
        if here:
            own, *both = moved_plan((await vehicle.home()).item(), items, areas)
            around = Areas(*both)
        if around.fence:
            await vehicle.upload_fence(around.fence, note)
        if around.rally:
            await vehicle.upload_rally(around.rally, note)
        if len(own) > 1 or not any(around):
            await vehicle.upload_mission(own, note)
        if not start:
            return f"UAV {vehicle.system} holds {_counts(items, areas)} of {file}"
        await vehicle.start_mission()
        if not vehicle.state.armed:
            await vehicle.arm()
        return f"UAV {vehicle.system} flies {_count(items)} of {file}"

    sizes = {key: len(held) for key, held in areas._asdict().items() if held}
    transfer.upload(station, send, {"items": len(items) - 1, "not_flown": not_flown, **sizes})


def _read(file: Path) -> tuple[Mission, tuple[str, ...]]:
    """Read a mission, and tell what is in its file that nobody flies."""
    items, not_flown = load_mission(file)
    if is_mission_file(file):  # a scenario tells by itself
        tell_not_flown(file, not_flown)
    return items, not_flown


class _Held(NamedTuple):
    """What a vehicle holds."""

    mission: Mission
    areas: Areas


async def _held_by(vehicle: Vehicle) -> _Held:
    """Download a mission, and fence and rally points of who has these types."""
    mission, areas = await vehicle.download_mission(), Areas()
    try:
        areas = Areas(await vehicle.download_fence(), await vehicle.download_rally())
    except CommandRefused as refusal:
        if refusal.result != dialect.MAV_MISSION_UNSUPPORTED:
            raise
    return _Held(mission, areas)


def _is_same(one: _Held, other: _Held) -> bool:
    pairs = zip(one.areas, other.areas, strict=True)
    return is_same(one.mission, other.mission) and all(is_same(a, b, first=0) for a, b in pairs)


def _text_of(out: Path, held: _Held) -> str:
    mission, areas = held
    if len(mission) < 2:
        raise BadInput(f"no mission to write to {out}: the vehicles hold none", "upload one first")
    is_plan = out.suffix.lower() == ".plan"
    return plan_text(mission, *areas) if is_plan else waypoints_text(mission)


def _counts(mission: Mission, areas: Areas) -> str:
    """Say how much there is of a mission, fence and rally points: "3 items, fence of 1 item"."""
    parts = [_count(mission)]
    if areas.fence:
        parts.append(f"a fence of {counted(len(areas.fence), 'item')}")
    if areas.rally:
        parts.append(counted(len(areas.rally), "rally point"))
    return ", ".join(parts)


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
    passed = {one.item: one for one in reversed(itinerary.passed)}
    for item in items[1:]:
        if (one := passed.get(item.seq)) is not None:
            places = (f"{value:.0f}" for value in (one.north_m, one.east_m, one.height_m))
            table.add_row(str(item.seq), item_text(item), *places)
            continue
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

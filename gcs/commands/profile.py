"""``gcs profile upload|download|check``: reference profiles of vehicles and of files."""

import operator
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from gcs.commands import transfer
from gcs.commands.station import StationOptions, station_command
from gcs.commands.transfer import Note
from gcs.console.errors import CommandRefused
from gcs.console.lines import print_json, print_line
from gcs.console.outputs import check_file
from gcs.console.terminal import console_of, numbers, table_of
from gcs.scenario.profile_file import load_profile, profile_yaml
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.models import counted
from mavlink_defs.profile import Segment

app = typer.Typer(help="Upload, download and check reference profiles.", no_args_is_help=True)

_File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="Profile: YAML with a `profile:` list, scenario, .plan or .waypoints."
    ),
]


@app.command()
@partial(station_command, timeout_s=30.0)
def upload(station: StationOptions, file: _File) -> None:
    """Upload a profile. It takes effect at once; if it is refused, the old one stays active.

    Examples:
        - gcs profile upload my.yaml
        - gcs profile upload paper/scenario1 --uav 1,3 --json
    """
    segments = load_profile(file)

    async def send(vehicle: Vehicle, note: Note) -> str:
        await vehicle.upload_profile(segments, note)
        return f"UAV {vehicle.system} holds {_count(segments)} of {file}"

    transfer.upload(station, send, {"segments": len(segments)})


@app.command()
@partial(station_command, timeout_s=30.0)
def download(
    station: StationOptions, out: Annotated[Path | None, typer.Option(metavar="FILE")] = None
) -> None:
    """Print the profiles of vehicles as YAML, one document for each distinct profile.

    Args:
        out: Write a profile file; all vehicles must have the same profile.

    Examples:
        - gcs profile download --uav 1 --out held.yaml
        - gcs profile download --json | jq '.[].profile | length'
    """
    if out is not None:
        check_file(out)
    held: dict[int, tuple[Segment, ...]] = {}

    async def action(vehicle: Vehicle) -> str:
        held[vehicle.system] = await vehicle.download_profile()
        return f"# UAV {vehicle.system} holds {_count(held[vehicle.system])}"

    def data(vehicle: Vehicle) -> dict[str, Any]:
        return {"profile": [segment.as_dict() for segment in held[vehicle.system]]}

    try:
        station.act(action, data)
    finally:
        if out is not None and held:
            transfer.write_held(out, held, "profile", operator.eq, profile_yaml)
        elif held and not station.as_json:
            print_line("---\n".join(map(profile_yaml, dict.fromkeys(held.values()))).rstrip("\n"))


@app.command()
@partial(station_command, timeout_s=30.0)
def check(
    station: StationOptions, file: _File, held: Annotated[bool, typer.Option("--held")] = False
) -> None:
    """Check a profile file and show it; with --held compare it with the vehicles' profiles.

    Args:
        held: Also compare with the profiles of the vehicles.

    Examples:
        - gcs profile check my.yaml
        - gcs profile check my.yaml --held --uav 3

    Exit status: 0 good (and held), 2 the file cannot be used, 3 a vehicle holds something else or
    refused to answer, 4 no answer from one.
    """
    segments = load_profile(file)
    if not held:
        if station.as_json:
            print_json({"file": str(file), "profile": [s.as_dict() for s in segments]})
        else:
            console_of(stderr=False).print(_table(segments), f"{file}: {_count(segments)}, good")
        return

    async def action(vehicle: Vehicle) -> str:
        theirs = await vehicle.download_profile()
        if theirs != segments:
            text = f"UAV {vehicle.system} holds another profile: {_difference(segments, theirs)}"
            raise CommandRefused(text, dialect.MAV_MISSION_ERROR)
        return f"UAV {vehicle.system} holds {file}"

    station.act(action)


def _count(segments: tuple[Segment, ...]) -> str:
    return counted(len(segments), "segment")


def _difference(ours: tuple[Segment, ...], theirs: tuple[Segment, ...]) -> str:
    for i, (ours_i, found) in enumerate(zip(ours, theirs, strict=False)):
        a, b = ours_i.as_dict(), found.as_dict()
        for key, value in a.items():
            if value != b[key]:
                return f"{key} of its segment {i} is {b[key]}, in the file {value}"
    return f"{_count(theirs)}, in the file {len(ours)}"


def _table(segments: tuple[Segment, ...]) -> Table:
    headings = ("", "start s", "airspeed m/s", "roll °", "pitch °", "yaw °", "shape")
    table = table_of(*map(numbers, headings), box=None, pad_edge=False)
    for i, segment in enumerate(segments):
        table.add_row(str(i), *(str(value) for value in segment.as_dict().values()))
    return table

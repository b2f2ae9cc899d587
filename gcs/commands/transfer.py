"""Uploads to vehicles, and files of what they hold: missions and profiles alike."""

from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from gcs.commands.station import StationOptions
from gcs.console.errors import BadInput
from gcs.console.outputs import write_file
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.station.vehicle import Vehicle

Note: TypeAlias = Callable[[int, int], None]
"""Notes how many items of how many a vehicle has received."""

T = TypeVar("T")


def upload(
    station: StationOptions, send: Callable[[Vehicle, Note], Awaitable[str]], data: dict[str, Any]
) -> None:
    """Send something to every chosen vehicle, with a bar for each; exit with the status.

    Args:
        station: Gives the vehicles.
        send: Sends it to a vehicle, and returns a line for the user.
        data: Further JSON data of every vehicle that has got it.
    """
    with working(console_of()) as work:

        async def action(vehicle: Vehicle) -> str:
            task = work.add(f"UAV {vehicle.system}", unit="items")

            def note(done: int, total: int) -> None:
                task.show(done, total=total)

            return await send(vehicle, note)

        station.act(action, lambda _: data)


def write_held(
    out: Path,
    held: Mapping[int, T],
    kind: str,
    same: Callable[[T, T], bool],
    text_of: Callable[[T], str],
) -> None:
    """Write what all vehicles hold to a file.

    Args:
        out: The file.
        held: What each vehicle holds, by system id; at least one does.
        kind: What it is, in the singular, for the error.
        same: Whether two are the same.
        text_of: Returns the text of the file.

    Raises:
        BadInput: They hold different ones, or the file cannot be there.
        OSError: It cannot be written; it is named.
    """
    first, *others = held.values()
    if not all(same(first, other) for other in others):
        names = ", ".join(map(str, sorted(held)))
        raise BadInput(f"UAV {names} hold different {kind}s", "choose one with --uav")
    write_file(out, text_of(first))

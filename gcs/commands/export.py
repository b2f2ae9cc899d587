"""``gcs export``: the recording of a flight in other programs' formats."""

from pathlib import Path
from typing import Annotated

import typer

from gcs.console.errors import FlightLost
from gcs.console.outputs import all_or_none, make_folder
from gcs.console.terminal import console_of
from gcs.results.choices import Format

EPILOG = """
Examples:

- gcs export runs/first --to csv
- gcs export runs/first --to kml --out /tmp
- gcs export runs/first --to ulg && ulog_info runs/first/uav3.ulg

npz (NumPy), csv and parquet: trajectory and events, as in the recording. kml: tracks, home and the
path of a mission for Google Earth. mcap: states, places and events for Foxglove and PlotJuggler.
ulg: a ULog file for each UAV, with PX4's topics, for PlotJuggler, Flight Review and pyulog.

Exit status: 0 written, 1 the recording is torn and was written up to there, or a file cannot be
written, 2 bad input.
"""


def export(
    run: Annotated[Path, typer.Argument(help="Run folder of gcs fly.", metavar="RUN")],
    to: Annotated[Format, typer.Option(help="Format of the files.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the files; RUN by default.", metavar="FOLDER")
    ] = None,
) -> None:
    """Convert the recording of a flight for other programs."""
    from gcs.results.export import convert
    from gcs.results.store import EVENTS, TRAJECTORY, is_complete

    folder = out or run
    if out is not None:
        make_folder(out)
    with all_or_none(folder / f"{name}.{to}" for name in ("events", "trajectory")):
        written = convert(run, to, folder)
    for path in written:
        console_of(stderr=False).print(path, soft_wrap=True)
    torn = [name for name in (TRAJECTORY, EVENTS) if not is_complete(run / name)]
    if torn:
        raise FlightLost(
            f"{' and '.join(torn)} of {run} {'are' if len(torn) > 1 else 'is'} torn: what was "
            "recorded before is written"
        )

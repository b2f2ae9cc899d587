"""``gcs export``: a flight, ours or of a log, in other programs' formats."""

from pathlib import Path
from typing import Annotated

import typer

from gcs.commands.options import LogColumnsOption, LogUavOption
from gcs.console.errors import BadInput, FlightLost
from gcs.console.outputs import all_or_none, make_folder
from gcs.console.terminal import console_of
from gcs.results.choices import Format
from gcs.results.logs.read import kind_of


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN")],
    to: Annotated[Format, typer.Option()],
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None,
    uav: LogUavOption = None,
    columns: LogColumnsOption = None,
) -> None:
    """Convert a recording, or a log, for other programs.

    Args:
        run: Run folder of gcs fly, or a log.
        to: Format of the files.
        out: Folder for the files; RUN, or the log's, by default.

    Examples:
        - gcs export runs/first --to csv
        - gcs export runs/first --to kml --out /tmp
        - gcs export runs/first --to ulg && ulog_info runs/first/uav3.ulg
        - gcs export 00000042.BIN --to csv --out /tmp

    npz (NumPy), csv and parquet: trajectory and events, as in the recording. kml: tracks, home and
    the path of a mission for Google Earth. mcap: states, places and events for Foxglove and
    PlotJuggler. ulg: a ULog file for each UAV, with PX4's topics, for PlotJuggler, Flight Review
    and pyulog.

    A log, as `gcs log` reads it, becomes one file beside it: csv and parquet with a row for each
    step of its fastest channel, npz with every channel at its own times, kml.
    --uav and --columns are of logs.

    Exit status: 0 written, 1 the recording is torn and was written up to there, or a file cannot be
    written, 2 bad input.
    """
    if run.is_file() and kind_of(run) not in {"recording", None}:
        _export_log(run, to, out or run.parent, uav, columns)
        return
    if uav is not None or columns is not None:
        option = "--columns" if uav is None else "--uav"
        raise BadInput(f"{option} is of logs, and {run} is a run folder", "leave it out")
    _export_run(run, to, out)


def _export_run(run: Path, to: Format, out: Path | None) -> None:
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


def _export_log(
    file: Path, to: Format, folder: Path, uav: int | None, columns: Path | None
) -> None:
    from gcs.results.export import convert_log
    from gcs.results.logs.read import read_flight

    flight = read_flight(file, uav, columns)
    stem = file.name.partition(".")[0]
    if (folder / f"{stem}.{to}").resolve() == file.resolve():
        raise BadInput(f"{file} would be written over itself", "choose another folder with --out")
    make_folder(folder)
    for path in convert_log(flight, to, folder, stem):
        console_of(stderr=False).print(path, soft_wrap=True)
    for remark in flight.remarks:
        console_of().print(f"remark: {remark}", soft_wrap=True)

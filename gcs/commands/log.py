"""``gcs log``: a log of any autopilot, in the dashboard or as a list of what is in it."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.commands.dashboard import has_terminal, run_dashboard
from gcs.commands.options import LogColumnsOption, LogUavOption, ThemeOption
from gcs.commands.station import run_interruptible
from gcs.console.errors import BadInput
from gcs.results.logs.read import kind_of, read_flight
from mavlink_defs.capture.tlog import TlogError, read_frames
from mavlink_defs.visible import visible

if TYPE_CHECKING:
    from gcs.tui.playback import Playback


def log(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    list_: Annotated[bool, typer.Option("--list")] = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
    speed: Annotated[float, typer.Option(min=0.1, max=30.0, metavar="FACTOR")] = 1.0,
    at: Annotated[float | None, typer.Option(min=0.0, metavar="S")] = None,
    uav: LogUavOption = None,
    columns: LogColumnsOption = None,
    theme: ThemeOption = "dark",
) -> None:
    """Replay a log of any autopilot, or list what is in it.

    The replay is in the dashboard, with seek and speed. Logs of `gcs fly` and `gcs record` are
    replayed by simulated time, with all their vehicles. The list has channels with units, rates and
    gaps, modes, texts, and what the log cannot say. A log of others shows no triggers, events or
    faults: it has none.

    Args:
        file: The log, or a run folder.
        list_: Print what is in it, as without a terminal; no dashboard.
        as_json: Print the same as JSON.
        speed: Replay speed: 1 is real time.
        at: Start at this time [s]: simulated time if the log has it, else since its start.

    Examples:
        - gcs log runs/first/flight.tlog
        - gcs log flight.tlog --at 19 --speed 0.5
        - gcs log 00000042.BIN --list
        - gcs log flight.csv --columns my_columns.yaml --json

    Reads .tlog (MAVLink 1 and 2), ArduPilot's .bin, PX4's .ulg (with the extra `logs`), .csv (.xz,
    .gz, .bz2), .parquet and .mat with a column map, and run folders.

    Exit status: 0 listed, or left by the operator, 2 bad input.
    """
    if list_ or as_json or (at is None and not has_terminal()):
        _list(file, uav, columns, as_json)
        return
    playback = _playback(file, uav, columns)
    playback.speed = speed
    if at is not None:
        _seek(playback, at)
    from gcs.tui.app import Dashboard

    run_interruptible(run_dashboard(Dashboard(playback, theme)))


def _list(file: Path, uav: int | None, columns: Path | None, as_json: bool) -> None:
    from gcs.console.lines import print_json
    from gcs.console.terminal import console_of
    from gcs.reports.log import log_json, log_tables

    flight = read_flight(file, uav, columns)
    if as_json:
        print_json(log_json(flight), indent=2)
        return
    console = console_of(stderr=False)
    for one in log_tables(flight):
        console.print(one, soft_wrap=isinstance(one, str))


def _playback(file: Path, uav: int | None, columns: Path | None) -> "Playback":
    """Return what is replayed: a telemetry log of a fleet as it is, all others from their table."""
    from gcs.tui.flight_frames import frames_of
    from gcs.tui.playback import Playback

    if kind_of(file) in {"tlog", None} and uav is None:
        playback = Playback(visible(file.name), _frames(file), time.monotonic)
        if playback.clock.is_simulated or not _is_of_one(file):
            return playback
    flight = read_flight(file, uav, columns)
    playback = Playback(flight.title, frames_of(flight, uav or 1), time.monotonic)
    is_simulated = any(one.clock == "simulated" for one in flight.channels.values())
    playback.clock = replace(playback.clock, is_simulated=is_simulated)
    return playback


def _is_of_one(file: Path) -> bool:
    """Return whether a telemetry log is of one vehicle, which says how it flies."""
    try:
        return not any("--uav" in remark for remark in read_flight(file).remarks)
    except BadInput:
        return False


def _frames(file: Path) -> Sequence[tuple[int, bytes]]:
    try:
        frames = list(read_frames(file))
    except OSError as problem:
        raise BadInput(f"cannot read {file}: {problem.strerror}") from problem
    except TlogError as problem:
        raise BadInput(str(problem), "`gcs record` writes telemetry logs") from problem
    if not frames:
        raise BadInput(f"{file}: no MAVLink frame in it")
    return frames


def _seek(playback: "Playback", at_s: float) -> None:
    if not playback.begin_s <= at_s <= playback.end_s:
        clock = "simulated time" if playback.clock.is_simulated else "time since its first frame"
        raise BadInput(
            f"--at {at_s:g}: {playback.title} has {clock} from {playback.begin_s:.1f} "
            f"to {playback.end_s:.1f} s"
        )
    playback.seek(at_s)

"""``gcs log``: a telemetry log in the dashboard."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.commands.dashboard import run_dashboard
from gcs.commands.options import ThemeOption
from gcs.commands.station import run_interruptible
from gcs.console.errors import BadInput
from mavlink_defs.capture.tlog import TlogError, read_frames
from mavlink_defs.visible import visible

if TYPE_CHECKING:
    from gcs.tui.playback import Playback

EPILOG = """
Examples:

- gcs log runs/first/flight.tlog
- gcs log flight.tlog --at 19 --speed 0.5

Exit status: 0 left by the operator, 2 bad input.
"""


def log(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Telemetry log (tlog).")],
    speed: Annotated[
        float,
        typer.Option(min=0.1, max=30.0, metavar="FACTOR", help="Replay speed: 1 is real time."),
    ] = 1.0,
    at: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="S",
            help="Start at this time [s]: simulated time if the log has it, else since its start.",
        ),
    ] = None,
    theme: ThemeOption = "dark",
) -> None:
    """Replay a telemetry log in the dashboard.

    It has seek and speed. Reads logs of `gcs fly` and `gcs record`, which are replayed by simulated
    time, and of other ground stations, MAVLink 1 as well.
    """
    try:
        frames = list(read_frames(file))
    except OSError as problem:
        raise BadInput(f"cannot read {file}: {problem.strerror}") from problem
    except TlogError as problem:
        raise BadInput(str(problem), "`gcs record` writes telemetry logs") from problem
    if not frames:
        raise BadInput(f"{file}: no MAVLink frame in it")
    from gcs.tui.app import Dashboard
    from gcs.tui.playback import Playback

    playback = Playback(visible(file.name), frames, time.monotonic)
    playback.speed = speed
    if at is not None:
        _seek(playback, at)
    run_interruptible(run_dashboard(Dashboard(playback, theme)))


def _seek(playback: "Playback", at_s: float) -> None:
    if not playback.begin_s <= at_s <= playback.end_s:
        clock = "simulated time" if playback.clock.is_simulated else "time since its first frame"
        raise BadInput(
            f"--at {at_s:g}: {playback.title} has {clock} from {playback.begin_s:.1f} "
            f"to {playback.end_s:.1f} s"
        )
    playback.seek(at_s)

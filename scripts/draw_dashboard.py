"""Draw docs/images/dashboard.svg: the dashboard at 22 s of a flight of scenario 1, replayed.

Flies the scenario over UDP with telemetry by simulated time, and opens the log as `gcs log` does.
"""

import asyncio
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gcs.tui.app import Dashboard
from gcs.tui.playback import Playback
from mavlink_defs.capture.tlog import read_frames

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "dashboard.svg"
SIZE = (160, 45)
AT_S = 22.0


def main() -> None:
    """Fly, replay, draw."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        options = ["--set", "links.telemetry_clock=simulated", "--free-ports", "--quiet"]
        command = [sys.executable, "-m", "gcs", "fly", "paper/scenario1", *options, "--out", out]
        subprocess.run(command, check=True)
        frames = list(read_frames(out / "flight.tlog"))
    asyncio.run(draw(frames))
    print(PICTURE)


async def draw(frames: list[tuple[int, bytes]]) -> None:
    """Draw the plots beside the fleet table."""
    playback = Playback("scenario 1", frames, time.monotonic)
    playback.seek(AT_S)
    playback.speed = 0.1
    app = Dashboard(playback, "dark")
    async with app.run_test(size=SIZE) as pilot:
        await pilot.press("3", "up", "2")
        await pilot.pause(3.0)
        PICTURE.write_text(app.export_screenshot(title="ftc-sitl"), encoding="utf-8")


if __name__ == "__main__":
    main()

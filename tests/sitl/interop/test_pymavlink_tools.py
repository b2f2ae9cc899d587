"""The tools that come with pymavlink read the log of a flight of ours."""

import subprocess
import sys
from pathlib import Path

import pytest
from flying import fly_well, write_scenario

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def tlog(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tools")
    scenario = write_scenario(folder, duration_s=1.0, faults=[])
    fly_well(scenario, "--quiet", "--free-ports", "--out", folder / "run")
    return folder / "run" / "flight.tlog"


def tool(*arguments: str | Path) -> str:
    """Return the output of a tool, which must not complain."""
    done = subprocess.run(
        [sys.executable, "-m", "mavlink_defs.runtime.run_with_dialect", *arguments],
        capture_output=True,
        text=True,
        timeout=600.0,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def test_mavlogdump(tlog: Path) -> None:
    lines = tool("mavlogdump.py", "--dialect", "ftc", "--types", "FTC_EVENTS", tlog).splitlines()
    assert len(lines) > 3
    assert all("FTC_EVENTS {time_boot_ms" in line for line in lines)
    assert "BAD_DATA" not in tool("mavlogdump.py", "--dialect", "ftc", "--show-types", tlog)


def test_mavtomfile(tlog: Path) -> None:
    tool("mavtomfile.py", "--dialect", "ftc", tlog)
    written = tlog.with_suffix(".m").read_text()  # it writes there, whatever the arguments
    for name in ("ATTITUDE", "FTC_EVENTS", "STATUSTEXT"):
        assert f"{name}.columns = " in written


def test_mavgraph(tlog: Path, tmp_path: Path) -> None:
    output = tmp_path / "roll.png"
    tool(
        "mavgraph.py",
        "--dialect",
        "ftc",
        "--output",
        output,
        tlog,
        "ATTITUDE.roll",
        "FTC_TRACKING.error[1]",
    )
    assert output.read_bytes().startswith(b"\x89PNG")

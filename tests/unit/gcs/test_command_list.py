"""Commands of other packages: found, shown, run; whatever is wrong with one is one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
COMMAND = """
from gcs.command_list import GcsCommand
hello = GcsCommand("their_hello", "Say hello.")
fly = GcsCommand("their_hello", "Take over.")
nothing = 3
"""
MODULE = '''
"""Of somebody else."""
from gcs.console.lines import print_line
EPILOG = "Examples: gcs hello"
def hello() -> None:
    """Say hello."""
    print_line("hello to you")
'''


def gcs(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(site), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "gcs", *arguments],
        env={**os.environ, "PYTHONPATH": paths, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "their_commands.py").write_text(COMMAND)
    (tmp_path / "their_hello.py").write_text(MODULE)
    (tmp_path / "broken_commands.py").write_text("import sys\nsys.exit(0)\n")
    info = tmp_path / "theirs-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.2\n")
    points = {"hello": "their_commands:hello", "fly": "their_commands:fly"}
    points |= {"nothing": "their_commands:nothing", "broken": "broken_commands:broken"}
    lines = [f"{name} = {value}" for name, value in points.items()]
    (info / "entry_points.txt").write_text("\n".join(["[ftc_sitl.commands]", *lines]))
    return tmp_path


def test_they_are_listed_and_run(site: Path) -> None:
    shown = gcs(site, "--help")
    assert shown.returncode == 0
    panel = shown.stdout.partition("Other packages")[2]
    assert "Say hello." in panel
    assert "theirs 1.2" in panel  # of which two cannot be imported
    assert gcs(site, "hello").stdout == "hello to you\n"
    assert "Say hello." in gcs(site, "hello", "--help").stdout


def test_none_takes_the_name_of_ours(site: Path) -> None:
    assert "Take over." not in gcs(site, "--help").stdout
    assert "Fly a scenario" in gcs(site, "fly", "--help").stdout


@pytest.mark.parametrize(("name", "why"), [("broken", "SystemExit"), ("nothing", "got int")])
def test_one_that_is_wrong_is_named(site: Path, name: str, why: str) -> None:
    done = gcs(site, name)
    assert done.returncode == 2
    first, hint = done.stderr.splitlines()
    assert name in first
    assert "theirs 1.2" in first
    assert why in first
    assert hint == "hint: mend or remove that package"

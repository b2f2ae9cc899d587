"""What commands print at 80 columns and in a pipe: nothing is cut."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gcs import tui
from gcs.cli import app
from gcs.tui.dialogs import key_name

COMMANDS = {
    "trim": ("trim", "paper/scenario1", "--airspeed", "50"),
    "scenarios": ("scenarios",),
    "mission": ("mission", "show", "missions/race_track"),
    "profile": ("profile", "check", "paper/scenario1"),
    "fly": ("fly", "paper/scenario1", "--set", "duration_s=0.05", "--in-process", "--record=none"),
    "mission_flight": ("fly", "missions/race_track", "--set", "duration_s=0.05", "--in-process"),
}


def shown(arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, columns: str) -> str:
    """What a command prints at a width; without one in a pipe."""
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    else:
        monkeypatch.delenv("COLUMNS", raising=False)
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, (done.exception, done.stderr)
    assert done.stdout
    return done.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_cut(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for columns in ("80", ""):
        out = ("--out", str(tmp_path / f"out{columns}")) if COMMANDS[name][0] == "fly" else ()
        text = shown(COMMANDS[name] + out, monkeypatch, columns)
        assert "…" not in text
        found.append(sorted(re.findall(r"-?\d+\.\d+", text.split("results in")[0])))
    of_its_own_time = {"scenarios", "fly"}  # prose is folded; a flight takes another time
    assert COMMANDS[name][0] in of_its_own_time or found[0] == found[1]


def test_trim_fits_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = shown(COMMANDS["trim"], monkeypatch, "80").splitlines()
    assert max(map(len, lines)) <= 80
    assert sum("stuck:" in line for line in lines) == 2


def test_keys_have_the_names_on_the_keyboard() -> None:
    bound = set()
    for path in Path(next(iter(tui.__path__))).rglob("*.py"):
        bound.update(re.findall(r'Binding\(\s*"([^"]+)"', path.read_text()))
    assert len(bound) > 20
    assert [key for key in bound if "_" in key_name(key)] == []

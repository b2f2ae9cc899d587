"""Help of every program and command on a narrow terminal: no broken word, no type of Python."""

import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from gcs.cli import whole_command

PROJECT = tomllib.loads((Path(__file__).parents[4] / "pyproject.toml").read_text())["project"]


def commands(command: Any, *names: str) -> Iterator[tuple[str, ...]]:
    yield names
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, *names, name)


HELPS = [
    (program, *names)
    for program in PROJECT["scripts"]
    for names in (commands(whole_command()) if program == "gcs" else [()])
]


@pytest.mark.parametrize("command", HELPS, ids=" ".join)
@pytest.mark.parametrize("columns", ["80", "100"])
def test_help(
    command: tuple[str, ...],
    columns: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr(sys, "argv", [*command, "--help"])
    module, _, name = PROJECT["scripts"][command[0]].partition(":")
    with pytest.raises(SystemExit) as ended:
        getattr(import_module(module), name)()
    text = capsys.readouterr().out
    assert not ended.value.code
    assert re.search(rf"sage: .*\b{' '.join(command[1:])} ", text)
    assert "…" not in text
    assert "[[" not in text
    assert not re.search(r"<\w|list\[|Path\]|\bNone\b", text)
    assert max(map(len, text.splitlines())) <= int(columns)


def test_every_program_and_command_is_there() -> None:
    assert len(HELPS) > 40
    assert {"ftc-autopilot", "sitl-plant", "ftc-mavlink"} <= {names[0] for names in HELPS}

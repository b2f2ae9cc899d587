"""Help of every program and command on a narrow terminal: no broken word, no type of Python."""

import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from gcs.commands.cli import main, whole_command

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


MAX_LINES = 70
"""Lines at 80 columns: `gcs`, and `gcs fault sensor set` with 30 options, have as many."""


def test_help(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    subtests: pytest.Subtests,
) -> None:
    assert len(HELPS) > 40
    assert {"ftc-autopilot", "sitl-plant", "ftc-mavlink"} <= {names[0] for names in HELPS}
    for command, columns in product(HELPS, (80, 100)):
        with subtests.test(" ".join(command), columns=columns):
            text = help_of(command, monkeypatch, capsys, columns)
            assert re.search(rf"sage: .*\b{' '.join(command[1:])} ", text)
            assert "…" not in text
            assert "[[" not in text
            assert not re.search(r"<\w|list\[|Path\]|\bNone\b", text)
            assert max(map(len, text.splitlines())) <= columns
            if command[0] == "gcs" and columns == 80:
                assert len(text.splitlines()) <= MAX_LINES
                named = re.findall(r"^│ (?:-\w, )?(--[\w-]+)", text, re.MULTILINE)
                assert "--help" in named
                assert len(named) == len(set(named))


def test_every_option_and_argument_says_what_it_is() -> None:
    found: list[tuple[tuple[str, ...], Any]] = [(("gcs",), whole_command())]
    silent = []
    for names, command in found:
        inner = getattr(command, "commands", {})
        found += [((*names, name), one) for name, one in inner.items()]
        silent += [
            f"{' '.join(names)} {one.name}"
            for one in command.params
            if not (one.help or getattr(one, "hidden", False))
        ]
    assert len(found) > 40
    assert silent == []


def test_help_in_a_pipe_is_folded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(sys, "argv", ["gcs", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert max(map(len, capsys.readouterr().out.splitlines())) < 1000


def test_the_help_of_gcs_begins_with_what_a_newcomer_needs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    panels = re.split(r"^╭─ ", help_of(("gcs",), monkeypatch, capsys), flags=re.MULTILINE)[1:]
    titles = [panel.split(" ─")[0] for panel in panels]
    assert titles == ["Fly", "Operate", "Study", "Aircraft and laws", "Wire", "Options"]
    first = re.findall(r"^│ (\w+)", panels[0], re.MULTILINE)
    assert {"new", "fly", "up", "start", "status", "fault", "runs", "compare"} <= set(first)
    assert len(first) <= 12


def test_the_help_of_runs_has_the_options_of_its_list(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = help_of(("gcs", "runs"), monkeypatch, capsys)
    assert all(option in text for option in ("--where", "--sort", "--number", "--json", "html"))


def test_options_of_sensors_and_of_actuators_are_not_in_one_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    actuator = help_of(("gcs", "fault", "set"), monkeypatch, capsys)
    assert "--bias-deg " in actuator
    assert "--bias-deg-s" not in actuator
    sensor = help_of(("gcs", "fault", "sensor", "set"), monkeypatch, capsys)
    assert "--bias-deg-s" in sensor
    assert "--bias-deg " not in sensor


def help_of(
    command: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    columns: int = 80,
) -> str:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys, "argv", [*command, "--help"])
    module, _, name = PROJECT["scripts"][command[0]].partition(":")
    with pytest.raises(SystemExit) as ended:
        getattr(import_module(module), name)()
    assert not ended.value.code
    return capsys.readouterr().out

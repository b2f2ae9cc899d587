"""Long commands say how far they are; where there is no terminal, in lines on standard error."""

import re
import threading
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs.commands.cli import app
from gcs.console import progress
from gcs.console.progress import Task, working
from gcs.console.terminal import console_of
from mavlink_defs.config.yaml_text import yaml_of

NOW = 100.0


def task_after(seconds: float, monkeypatch: pytest.MonkeyPatch, **options: Any) -> Task:
    """A task of 20 flights that began some seconds ago."""
    settings = {"total": 20.0, "unit": "flights", "done": 0.0, "rated": True, **options}
    monkeypatch.setattr("gcs.console.progress.time.monotonic", lambda: NOW - seconds)
    task = Task("flying", **settings)
    monkeypatch.setattr("gcs.console.progress.time.monotonic", lambda: NOW)
    return task


def test_a_line_says_what_is_done_and_when_the_rest_will_be(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = task_after(10.0, monkeypatch, done=5.0)
    task.show(15, "1 not completed")
    assert task.line() == "flying: 15 of 20 flights, 1.0 flights/s, 1 not completed, 5 s left"
    task.show(25, total=25)
    assert task.line() == "flying: 25 of 25 flights, 2.0 flights/s"
    assert task.is_done


def test_a_slow_one_counts_by_the_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    task = task_after(30.0, monkeypatch)
    task.advance()
    assert task.line() == "flying: 1 of 20 flights, 2.0 flights/min, 570 s left"


def test_what_cannot_be_counted_says_how_long_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert task_after(45.0, monkeypatch, unit="").line() == "flying: 45 s so far"


def test_nothing_done_yet_promises_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert task_after(45.0, monkeypatch).line() == "flying: 0 of 20 flights"


def test_lines_appear_while_nothing_moves(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = threading.Event()

    def line(_: Task) -> str:
        printed.set()
        return "a line"

    monkeypatch.setattr(progress, "EVERY_S", 1e-3)
    monkeypatch.setattr(Task, "line", line)
    with working(console_of(), "thinking"):
        assert printed.wait(60.0)
    captured = capsys.readouterr()
    assert captured.err.startswith("a line\n")
    assert captured.out == ""


def test_silence_is_counted_over_all_that_a_command_does(monkeypatch: pytest.MonkeyPatch) -> None:
    printed, now = threading.Event(), 0.0

    def line(_: Task) -> str:
        printed.set()
        return "a line"

    monkeypatch.setattr(Task, "line", line)
    monkeypatch.setattr(progress.Work, "last_line_s", 0.0)
    monkeypatch.setattr("gcs.console.progress.time.monotonic", lambda: now)
    with working(console_of(), "the first half"):
        now = 0.8 * progress.EVERY_S
    with working(console_of(), "the second half"):
        now = 1.2 * progress.EVERY_S
        assert printed.wait(10.0)
    printed.clear()
    with working(console_of(), "the rest"):
        assert not printed.wait(3.0 * progress.LOOK_S)


def campaign_file(folder: Path) -> Path:
    """A campaign of two short flights."""
    base = {"extends": "paper/scenario1", "duration_s": 0.05, "faults": []}
    (folder / "base.yaml").write_text(yaml_of(base))
    file = folder / "camp.yaml"
    tree = {
        "name": "camp",
        "scenario": "base.yaml",
        "design": "random",
        "draws": 2,
        "seed": 1,
        "factors": {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.9, "high": 1.1}}},
    }
    file.write_text(yaml_of(tree))
    return file


@pytest.mark.parametrize("command", ["fly", "sweep", "campaign", "baseline", "trim"])
def test_results_go_to_standard_output_and_progress_to_standard_error(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "EVERY_S", 1e-3)
    short = ("paper/scenario1", "--set", "duration_s=0.05")
    out = ("--out", str(tmp_path / "out"))
    arguments = {
        "fly": (*short, "--in-process", *out),
        "sweep": (*short, *out, "--jobs", "1"),
        "campaign": (str(campaign_file(tmp_path)), *out, "--jobs", "1"),
        "baseline": (*short, "--no-per-channel", *out),
        "trim": ("paper/scenario1",),
    }[command]
    done = CliRunner().invoke(app, [command, *arguments])
    assert done.exit_code == 0, (done.exception, done.stderr)
    assert re.search(r"events|saving|variant|Baselines|stuck", done.stdout)
    assert "results in" in done.stdout or command == "trim"
    assert re.search(r"^[^:]+: .*(s so far|of|flights)", done.stderr, re.MULTILINE), done.stderr
    assert "results in" not in done.stderr
    assert "so far" not in done.stdout

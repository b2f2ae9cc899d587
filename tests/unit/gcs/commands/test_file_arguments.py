"""Every file that a command reads, as what nobody wants to read: refused at once, in one line."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs.commands.cli import app, whole_command
from gcs.console.errors import BadInput
from mavlink_defs.config.problems import ConfigError

NOWHERE = ("--connect", "udpout:127.0.0.1:1", "--timeout", "0.1")
ROOT = Path(__file__).parents[4]
PAPER = str(ROOT / "scenarios" / "paper" / "scenario1.yaml")
TABLE = str(ROOT / "tests" / "data" / "nesc_tumbling_brick.csv")
READ = {
    ("fly", "scenario"): ["fly", "@"],
    ("fly", "campaign"): ["fly", "--campaign", "@", "--row", "0"],
    ("export", "run"): ["export", "@", "--to", "csv"],
    ("reproduce", "scenarios"): ["reproduce", "--scenarios", "@", "--out", "none"],
    ("compare", "old"): ["compare", "@", "@"],
    ("sweep", "scenarios"): ["sweep", "@", "--set", "seed=1", "--out", "none"],
    ("baseline", "scenario"): ["baseline", "@"],
    ("baseline", "campaign"): ["baseline", PAPER, "--aircraft", "1", "--campaign", "@"],
    ("campaign", "file"): ["campaign", "@", "--out", "none"],
    ("trim", "scenario"): ["trim", "@"],
    ("runs note", "run"): ["runs", "note", "@", "text"],
    ("identify", "source"): ["identify", "--from", "@", "--aircraft", "aerosonde"],
    ("identify", "columns"): ["identify", TABLE, "--aircraft", "aerosonde", "--columns", "@"],
    ("up", "scenario"): ["up", "@", "--free-ports"],
    ("config", "scenario"): ["config", "@", "--out", "none"],
    ("log", "file"): ["log", "@"],
    ("log", "columns"): ["log", TABLE, "--columns", "@"],
    ("export", "columns"): ["export", TABLE, "--to", "csv", "--columns", "@"],
    ("diagnose", "flight"): ["diagnose", "@"],
    ("diagnose", "columns"): ["diagnose", TABLE, "--columns", "@"],
    ("estimate", "flight"): ["estimate", "@"],
    ("estimate", "columns"): ["estimate", TABLE, "--columns", "@"],
    ("estimate", "sensors"): ["estimate", TABLE, "--sensors", "@"],
    ("replay-fault", "flight"): ["replay-fault", "@", "--aircraft", "aerosonde", "--out", "none"],
    ("replay-fault", "columns"): ["replay-fault", TABLE, "--columns", "@", "--out", "none"],
    ("wire", "file"): ["wire", "@"],
    ("profile upload", "file"): ["profile", "upload", "@", *NOWHERE],
    ("profile check", "file"): ["profile", "check", "@", *NOWHERE],
    ("mission show", "file"): ["mission", "show", "@"],
    ("mission show", "fleet"): ["mission", "show", PAPER, "--fleet", "@"],
    ("mission upload", "file"): ["mission", "upload", "@", *NOWHERE],
    ("mission fly", "file"): ["mission", "fly", "@", *NOWHERE],
    ("param load", "file"): ["param", "load", "@", *NOWHERE],
    ("param diff", "file"): ["param", "diff", "@", *NOWHERE],
    ("status", "signing_key"): ["status", "--signing-key", "@", *NOWHERE],
    ("fly", "signing_key"): ["fly", PAPER, "--signing-key", "@", "--out", "none"],
    ("up", "signing_key"): ["up", PAPER, "--signing-key", "@", "--free-ports"],
    ("config", "signing_key"): ["config", PAPER, "--signing-key", "@", "--out", "none"],
}
"""What each argument that is read is called, and a command that reads it as ``@``."""

WRITTEN = {"out", "junit", "markdown", "csv"} | {
    f"{command} file" for command in ("new", "record", "key", "param save")
}
"""Arguments that are written: names of options, or command and argument."""

KINDS = ("pipe", "folder", "device", "large", "binary", "missing")


def make(kind: str, path: Path) -> Path:
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        return Path("/dev/zero")
    elif kind == "large":
        path.write_text("# nothing\n" * 200_000)
        path.chmod(0o600)
    elif kind == "binary":
        path.write_bytes(bytes(range(256)) * 8)
        path.chmod(0o600)
    return path


@contextmanager
def ten_seconds() -> Iterator[None]:
    """A command that waits for a pipe fails instead of waiting for ever."""

    def late(*_: Any) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(10)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_it_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subtests: pytest.Subtests
) -> None:
    for kind in KINDS:
        folder = tmp_path / kind
        folder.mkdir()
        monkeypatch.chdir(folder)
        path = make(kind, folder / "thing")
        before = sorted(folder.iterdir())
        for argument, words in READ.items():
            with subtests.test(" ".join(argument), kind=kind):
                given = [str(path) if word == "@" else word for word in words]
                with ten_seconds():
                    runner = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"})
                    result = runner.invoke(app, given)
                problem = result.exception
                assert isinstance(problem, BadInput | ConfigError), (problem, result.output)
                first = str(problem).splitlines()[0]
                assert path.name in first or path.name in str(problem)
                assert first == first.strip()
                assert first.isprintable()
                assert result.stdout == ""
                assert sorted(folder.iterdir()) == before


def test_every_argument_that_is_a_file_is_read_here_or_written() -> None:
    def walk(command: Any, *names: str) -> Iterator[tuple[str, Any]]:
        for name, inner in getattr(command, "commands", {}).items():
            yield from walk(inner, *names, name)
        if not hasattr(command, "commands"):
            yield from ((" ".join(names), parameter) for parameter in command.params)

    of_folders = {("runs list", "folder"), ("runs html", "folder"), ("runs html", "compare")}
    known = set(READ) | {("compare", "new"), ("new", "project")} | of_folders
    for command, parameter in walk(whole_command()):
        descriptor = getattr(parameter, "type_descriptor", None)
        if "Path" not in str(getattr(descriptor, "annotation", "")):
            continue
        if parameter.name in WRITTEN or f"{command} {parameter.name}" in WRITTEN:
            continue
        if parameter.name == "signing_key":
            continue  # one option, of one door
        assert (command, parameter.name) in known

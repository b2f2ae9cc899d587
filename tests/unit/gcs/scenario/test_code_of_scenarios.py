"""Code that a scenario names: what flies says in a line that it is run, what reads runs none."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from own_laws import PLAIN
from typer.testing import CliRunner

from gcs import fly, open_run
from gcs.commands.cli import app

NOWHERE = ("--connect", "udpout:127.0.0.1:1", "--timeout", "0.1")
TREE = """\
extends: BASE
duration_s: 0.02
controller: {kind: "law.py:Mine", attitude_gain: 3}
guidance: {kind: "law.py:Way"}
trigger: {mode: "law.py:Often"}
"""
OTHERS = """
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.guidance.laws.base import GuidanceParameters


class Often(TriggerParameters):
    @staticmethod
    def step(now, parameters, state):
        return 15


class Way(GuidanceParameters):
    @staticmethod
    def step(now, path, s, coordination, aircraft, limits, gains, state, command):
        return command
"""


def marked_law(folder: Path) -> str:
    """A law whose file, when it is run, leaves a file behind."""
    marker = f"__import__('pathlib').Path({str(folder / 'ran')!r}).touch()"
    return f"{PLAIN.replace('class Mine', marker + chr(10) * 3 + 'class Mine', 1)}{OTHERS}"


def make(folder: Path) -> None:
    """Two scenarios beside a law: with a profile, and with a mission."""
    (folder / "law.py").write_text(marked_law(folder))
    (folder / "profile.yaml").write_text(TREE.replace("BASE", "paper/scenario1"))
    (folder / "mission.yaml").write_text(TREE.replace("BASE", "missions/race_track"))


def invoke(*arguments: str) -> Any:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, arguments)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of such a law, which has changed since: whoever loads it runs it again."""
    folder = tmp_path_factory.mktemp("flown")
    make(folder)
    for name in ("one", "two"):
        fly(folder / "profile.yaml", out=folder / name, over_udp=False)
    (folder / "law.py").write_text(f"{(folder / 'law.py').read_text()}\n# another\n")
    (folder / "ran").unlink()
    return folder


READING = {
    **{f"export {to}": f"export one --to {to} --out ." for to in ("ulg", "csv", "kml", "mcap")},
    "mission show": "mission show mission.yaml",
    "mission show --fleet": "mission show mission.yaml --fleet mission.yaml",
    "mission upload": "mission upload mission.yaml",
    "profile check": "profile check profile.yaml",
    "profile upload": "profile upload profile.yaml",
    "runs list": "runs list .",
    "runs html": "runs html . --out page.html",
    "runs note": "runs note one text",
    "compare": "compare one two",
    "trim": "trim profile.yaml --airspeed 50",
    "ardupilot": "ardupilot profile.yaml --uav 9",
}


@pytest.mark.parametrize("command", READING)
def test_what_reads_runs_no_code(
    command: str, flown: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(flown)
    (flown / "ran").unlink(missing_ok=True)
    words = READING[command].split()
    words += NOWHERE if words[1] in {"upload", "check"} else ()
    done = invoke(*words)
    assert not (flown / "ran").exists()
    expected = {"ardupilot": "BadInput", "mission upload": "NoAnswer", "profile upload": "NoAnswer"}
    raised = "SystemExit" if done.exception is None else type(done.exception).__name__
    assert raised == expected.get(command, "SystemExit"), (done.exception, done.output)
    assert "runs " not in done.stderr


def test_a_run_that_is_opened_runs_no_code_until_it_is_flown_again(
    flown: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run = open_run(flown / "one")
    assert run.scenario.controller.model_dump()["attitude_gain"] == 3
    assert len(run.plot().axes) > 0
    assert not (flown / "ran").exists()
    changes = {"plugins": None}  # its code has changed since
    again = fly(run.scenario, changes)
    assert again.completed
    assert (flown / "ran").exists()
    (flown / "ran").unlink()
    assert capfd.readouterr().err.count(f"runs {flown}/law.py, code ") == 1


FLYING = {
    "fly": "fly profile.yaml --in-process --record none --no-figures --quiet --json --out run",
    "fly --with": "fly paper/scenario1 --with profile.yaml --in-process --record none "
    "--no-figures --json --out run",
    "sweep": "sweep profile.yaml --set seed=1,2 --jobs 1 --out run",
    "config": "config profile.yaml --out run",
    "laws show": "laws show law.py:Mine",
    "triggers header": "triggers header law.py:Often",
}


@pytest.mark.parametrize("command", FLYING)
def test_what_flies_says_once_which_code_it_runs(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path)
    monkeypatch.chdir(tmp_path)
    done = invoke(*FLYING[command].split())
    assert done.exit_code == 0, (done.exception, done.output)
    assert (tmp_path / "ran").exists()
    line = rf"^runs {tmp_path}/law\.py, code [0-9a-f]{{16}}$"
    assert len(re.findall(line, done.stderr, re.MULTILINE)) == 1, done.stderr
    assert "runs /" not in done.stdout


STUBBORN = """\
import os, signal, time
os.kill(os.getpid(), signal.SIG{name})
end = time.monotonic() + 20.0
while time.monotonic() < end:
    try:
        time.sleep(0.01)
    except BaseException:
        pass
"""


@pytest.mark.parametrize(("name", "status"), [("INT", -2), ("TERM", -15)])
def test_an_import_that_catches_everything_is_ended_by_name(
    tmp_path: Path, name: str, status: int
) -> None:
    make(tmp_path)
    (tmp_path / "law.py").write_text(STUBBORN.format(name=name))
    done = subprocess.run(
        [sys.executable, "-m", "gcs", "config", "profile.yaml", "--out", "out"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # as of a shell
    )
    assert done.returncode == status, done.stderr
    first, last = done.stderr.splitlines()
    assert first.startswith(f"runs {tmp_path}/law.py, code ")
    assert last == f"interrupted while {tmp_path}/law.py is being imported"
    assert not (tmp_path / "out").exists()

"""A flight is flown and marked the same way, whoever asks for it."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs import fly
from gcs.commands.cli import app
from gcs.fleet.in_process import fly_in_steps
from gcs.results.flight_mark import read_mark
from gcs.results.recording import Ending

PAPER = "paper/scenario1"
REASON = "UAV 1 was lost at 0.050 s: it hit the ground"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What is asked of the processes of a flight that is lost."""
    asked: dict[str, Any] = {}

    async def lost(
        scenario: Any, _: Path, add: Any, speed: Any, *__: Any, **options: Any
    ) -> Ending:
        asked.update(options, speed=speed)
        return dataclasses.replace(fly_in_steps(scenario, add), loss=REASON)

    monkeypatch.setattr("gcs.fleet.flying.fly_over_udp", lost)
    return asked


def test_command_line_and_python_ask_for_the_same_and_leave_the_same_mark(
    asked: dict[str, Any], tmp_path: Path
) -> None:
    flight = fly(
        PAPER, {"duration_s": 0.05}, over_udp=True, speed=2.0, restart=True, out=tmp_path / "python"
    )
    assert flight.loss == REASON
    assert flight.folder == tmp_path / "python"
    by_python = {key: asked.pop(key) for key in ("speed", "restart", "autopilot_processes")}
    assert by_python == {"speed": 2.0, "restart": True, "autopilot_processes": None}

    options = ["--free-ports", "--no-figures", "--speed=2", "--restart=on-failure"]
    arguments = ["fly", PAPER, *options, "--set=duration_s=0.05", "--out", str(tmp_path / "run")]
    done = CliRunner().invoke(app, arguments)
    assert str(done.exception) == REASON
    assert {key: asked[key] for key in by_python} == by_python
    python, command = (read_mark(tmp_path / name) for name in ("python", "run"))
    assert python is not None
    assert command is not None
    assert python.ended == REASON
    assert dataclasses.replace(python, started="") == dataclasses.replace(command, started="")

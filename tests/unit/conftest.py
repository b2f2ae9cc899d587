"""A scenario that is flown in no time, and commands that begin with their test."""

import time
from pathlib import Path

import pytest

from gcs.console.progress import Work

SCENARIO_1 = Path(__file__).parents[2] / "scenarios" / "paper" / "scenario1.yaml"


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Scenario 1, for 50 ms."""
    path = tmp_path / "short.yaml"
    path.write_text(f"extends: {SCENARIO_1}\nduration_s: 0.05\n")
    return path


@pytest.fixture(autouse=True)
def begun_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no progress be due because the process is old: of a command, it is as old as that."""
    monkeypatch.setattr(Work, "last_line_s", time.monotonic())

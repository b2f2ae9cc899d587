"""A scenario that is flown in no time."""

from pathlib import Path

import pytest

SCENARIO_1 = Path(__file__).parents[2] / "scenarios" / "paper" / "scenario1.yaml"


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Scenario 1, for 50 ms."""
    path = tmp_path / "short.yaml"
    path.write_text(f"extends: {SCENARIO_1}\nduration_s: 0.05\n")
    return path

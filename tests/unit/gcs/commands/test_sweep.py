"""The exit status of `gcs sweep`."""

from pathlib import Path
from typing import Any

import pytest

from gcs.commands.sweep import sweep
from gcs.errors import GcsError
from gcs.fleet.in_process import fly_in_process
from gcs.sweeps import flying

SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"


@pytest.mark.parametrize(
    ("problem", "ends_with"),
    [(ZeroDivisionError("by nothing"), ZeroDivisionError), (MemoryError("too long"), GcsError)],
)
def test_a_defect_is_told_when_everything_is_flown(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    problem: Exception,
    ends_with: type[Exception],
) -> None:
    """The other results are kept, and the command ends as any that meets a defect of ours."""
    fly = fly_in_process

    def broken(scenario: Any, *others: Any) -> Any:
        if scenario.duration_s < 0.05:
            raise problem
        return fly(scenario, *others)

    monkeypatch.setattr(flying, "fly_in_process", broken)
    with pytest.raises(ends_with):
        sweep([SCENARIO_1], ["duration_s=0.04,0.05"], tmp_path / "out", 1, None, quiet=True)
    table = (tmp_path / "out" / "table.csv").read_text()
    assert (
        f"failed,{'not enough memory' if ends_with is GcsError else 'ZeroDivisionError'}" in table
    )
    assert table.count(",completed,") == 3

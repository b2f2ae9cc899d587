"""Several UAVs on one path without a formation bring a warning."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from gcs.commands.common import changed_scenario, warn_of_one_path

HEXAGON = Path("missions/hexagon")


def warned(name: Path, settings: list[str]) -> str:
    console = Console(file=io.StringIO(), width=40)
    warn_of_one_path(changed_scenario(name, None, settings), console)
    text = console.file.getvalue()  # type: ignore[attr-defined]  # a StringIO, as given above
    return str(text)


def test_uavs_on_one_path_are_named_in_one_line() -> None:
    text = warned(HEXAGON, ["formation=null"])
    assert text.startswith("warning: UAVs 1, 2, 3 fly one path, and nothing keeps them apart")
    assert text.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "settings"), [(HEXAGON, []), (Path("paper/scenario1"), ["formation=null"])]
)
def test_slots_or_a_profile_bring_no_warning(name: Path, settings: list[str]) -> None:
    assert warned(name, settings) == ""

"""Sensors that do not observe everything at all times bring a warning."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from gcs.commands.common import changed_scenario, warn_of_sensors


@pytest.mark.parametrize(
    ("settings", "begins"),
    [
        (
            ["magnetometer.fitted=false"],
            "warning: sensors.navigation.magnetometer.fitted is false:",
        ),
        (["pitot.fitted=false"], "warning: sensors.navigation.pitot.fitted is false: without a"),
        ([], ""),
    ],
)
def test_what_is_not_fitted_is_named_in_one_line(settings: list[str], begins: str) -> None:
    console = Console(file=io.StringIO(), width=40)
    keys = ["navigation=estimated", *(f"sensors.navigation.{key}" for key in settings)]
    warn_of_sensors(changed_scenario(Path("paper/scenario1"), None, keys), console)
    text = console.file.getvalue()  # type: ignore[attr-defined]  # a StringIO, as given above
    assert text.startswith(begins)
    assert text.count("\n") == len(settings)

"""The picture of an aircraft's polar, and the curves in it."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ftc_lab.figures.polar import draw_polar, polar
from gcs.commands.cli import app
from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.airframe.level_flight import level_flight


def test_below_the_stall_the_curves_are_the_coefficients() -> None:
    aerosonde = load_aircraft("aerosonde")
    c, alpha = aerosonde.coefficients, np.array([-5.0, 0.0, 8.0])
    lift, drag = polar(aerosonde, alpha)
    assert lift == pytest.approx(c.cL0 + c.cL_alpha * np.radians(alpha), abs=1e-4)
    assert drag == pytest.approx(c.cD0 + c.cD_alpha * np.radians(alpha), abs=1e-4)


@pytest.mark.parametrize("name", ["aerosonde", "paper"])
def test_a_glide_is_marked_where_the_polar_has_a_flattest_one(name: str) -> None:
    aircraft = load_aircraft(name)
    flight = level_flight(aircraft, 24.0 if name == "aerosonde" else 45.0)
    assert flight is not None
    panels = draw_polar(aircraft, flight).axes
    labels = [str(line.get_label()) for line in panels[0].lines]
    assert any("level flight" in label for label in labels)
    assert any("glide" in label for label in labels) is (name == "aerosonde")
    assert ("stall" in labels) is (name == "aerosonde")


def test_the_command_writes_it_and_refuses_a_folder_in_use(tmp_path: Path) -> None:
    out = tmp_path / "polar"
    assert CliRunner().invoke(app, ["aircraft", "aerosonde", "--out", str(out)]).exit_code == 0
    assert {path.name for path in out.iterdir()} == {"polar.png", "polar.svg"}
    again = CliRunner().invoke(app, ["aircraft", "aerosonde", "--out", str(out)])
    assert again.exit_code != 0
    nameless = CliRunner().invoke(app, ["aircraft", "--out", str(tmp_path / "other")])
    assert nameless.exit_code != 0
    assert not (tmp_path / "other").exists()

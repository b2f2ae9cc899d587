"""Lists of laws, triggers and guidance laws: what each is, when to choose it, and where more is."""

import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from gcs.commands.cli import app, main

DOCS = Path(__file__).parents[4] / "docs"
OURS: list[tuple[str, str, Any]] = [
    (command, name, model)
    for command, models in (("laws", LAWS), ("triggers", TRIGGERS), ("guidance", GUIDANCE_LAWS))
    for name, model in models.items()
]
OWN = '''
from ftc_autopilot.control.laws.base import LawParameters

class Mine(LawParameters):
    """Holds everything.

    Choose it never.
    """

    PAGE = "https://example.org/mine"
    kind: str = "mine"

    @staticmethod
    def step(now, aircraft, gains, state): ...
'''


@pytest.mark.parametrize(("command", "name", "model"), OURS, ids=str)
def test_each_of_ours_says_when_to_choose_it_and_has_a_page(
    command: str, name: str, model: Any
) -> None:
    text = " ".join(CliRunner().invoke(app, [command, "show", name]).stdout.split())
    assert "Choose it" in text
    assert "Parameters of" not in text.partition("┏")[0]
    assert (DOCS / model.PAGE).exists()
    assert f"More: {model.PAGE}" in text
    assert name in (DOCS / model.PAGE).read_text()


def test_a_plug_in_gives_its_own_text_and_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(OWN)
    text = CliRunner().invoke(app, ["laws", "show", "mine.py:Mine"]).stdout
    assert "Holds everything." in text
    assert "More: https://example.org/mine\n" in text


@pytest.mark.parametrize(("command", "name", "_model"), OURS, ids=str)
def test_a_name_that_is_nearly_right_is_answered_by_the_right_one(
    command: str, name: str, _model: Any, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(sys, "argv", ["gcs", command, "show", f"{name}x"])
    with pytest.raises(SystemExit):
        main()
    assert f"did you mean '{name}'?" in capsys.readouterr().err

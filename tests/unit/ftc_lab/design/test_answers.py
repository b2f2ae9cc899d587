"""What `gcs identify` says that `gcs design` would say is what it says."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ftc_autopilot.control.laws import KINDS
from ftc_lab.design.answers import answers_of, laws_of, sentences_of
from gcs.commands.cli import app
from gcs.console.errors import BadInput
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.bundled import aircraft_names
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import yaml_of
from sitl_plant.airframe.config import Aircraft


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("answers")


def designed(file: Path | str) -> Iterator[str]:
    """Yield the laws that `gcs design` derives a flight with."""
    for law in KINDS:
        result = CliRunner().invoke(app, ["design", str(file), "--law", law])
        assert result.exception is None or isinstance(result.exception, BadInput | ConfigError)
        if result.exception is None:
            yield law


@pytest.mark.parametrize("name", aircraft_names())
def test_bundled_aircraft_are_answered_as_designed(name: str) -> None:
    assert laws_of(answers_of(load_aircraft(name))) == list(designed(name))


def heavier(name: str, inertia: float, **keys: Any) -> Aircraft:
    """A bundled aircraft with so many times its inertia, and other keys."""
    tree = load_aircraft(name).model_dump(exclude_none=True)
    tree["inertia_kg_m2"] = {axis: inertia * J for axis, J in tree["inertia_kg_m2"].items()}
    return Aircraft.model_validate(tree | keys)


@settings(max_examples=4)
@given(
    st.sampled_from(["aerosonde", "paper", "skywalker_x8", "c172p"]),
    st.floats(0.3, 100.0),
    st.sampled_from([{}, {"thrust_limit_n": 30.0}, {"thrust_limit_n": 1e5}]),
)
@example("aerosonde", 100.0, {})  # slower than any law was meant for, as an airliner is
@example("aerosonde", 1.0, {"thrust_limit_n": 5.0})  # no thrust for level flight
def test_any_aircraft_is_answered_as_designed(
    folder: Path, name: str, inertia: float, keys: dict[str, Any]
) -> None:
    aircraft = heavier(name, inertia, **keys)
    file = folder / "mine.yaml"
    file.write_text(yaml_of(aircraft.model_dump(exclude_none=True)))
    assert laws_of(answers_of(aircraft)) == list(designed(file))


def test_an_airliner_is_refused_in_one_sentence() -> None:
    (line,) = sentences_of(answers_of(heavier("aerosonde", 100.0)))
    assert line.startswith("`gcs design` refuses it: the aircraft is ")
    assert "times slower than the laws' home aircraft, expected at most 4" in line


def test_what_one_law_refuses_is_said_of_that_law() -> None:
    answers = {"pid": None, "tube": "no", "surviving": "no", "proposed": None}
    assert sentences_of(answers) == [
        "`gcs design` with --law pid, proposed derives a flight from it",
        "`gcs design` with --law tube, surviving refuses it: no",
    ]

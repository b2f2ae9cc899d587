"""Aircraft named by a scenario: bundled ones, and files beside it."""

from pathlib import Path

import pytest

from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.bundled import SCENARIOS, aircraft_names
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import with_values
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import yaml_of

OF_THEIR_OWN = """
extends: airframes/aerosonde
name: Mine
aircraft: mine.yaml
"""


def test_the_paper_s_aircraft_is_the_one_of_its_scenarios(scenario1: Scenario) -> None:
    paper = load_aircraft("paper")
    assert paper.source
    ours = {"source": "", "cruise_m_s": None, "gear": None}
    assert paper.model_copy(update=ours) == scenario1.aircraft


@pytest.mark.parametrize("name", aircraft_names())
def test_bundled_aircraft_say_where_their_numbers_are_from(name: str) -> None:
    assert len(load_aircraft(name).source) > 40


def test_an_aircraft_takes_the_place_of_another_one_whole() -> None:
    """The Aerosonde has forces of its surfaces: the paper's aircraft in its place has none."""
    assert load_scenario("airframes/aerosonde").aircraft == load_aircraft("aerosonde")
    tree = with_values(scenario_tree("paper/scenario1"), {"aircraft.coefficients.cL_q": 7.0})
    changed = scenario_of("x", with_values(tree, {"aircraft": "paper"}))
    assert changed.aircraft == load_aircraft("paper")


def test_a_scenario_that_extends_nothing_holds_no_null(tmp_path: Path) -> None:
    """What a flight stores of its scenario can be read again, and compared."""
    path = tmp_path / "whole.yaml"
    path.write_text(yaml_of(scenario_tree("paper/scenario1") | {"aircraft": "paper"}))
    tree = scenario_tree(path)
    assert None not in {**tree["aircraft"], **tree["aircraft"]["coefficients"]}.values()
    assert scenario_of(path, tree).aircraft == load_aircraft("paper")


def test_a_scenario_is_no_aircraft() -> None:
    with pytest.raises(ConfigError, match="a scenario, not an aircraft"):
        load_aircraft(str(SCENARIOS / "paper" / "scenario1.yaml"))


def test_a_file_beside_the_scenario_may_extend_a_bundled_one(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("extends: aerosonde\nmass_kg: 12.5\n")
    (tmp_path / "scenario.yaml").write_text(OF_THEIR_OWN)
    known = load_aircraft("aerosonde")
    aircraft = load_scenario(tmp_path / "scenario.yaml").aircraft
    assert aircraft == known.model_copy(update={"mass_kg": 12.5})


def test_keys_of_a_section_are_merged_into_a_named_aircraft(tmp_path: Path) -> None:
    (tmp_path / "scenario.yaml").write_text(
        "extends: airframes/aerosonde\nname: Heavy\naircraft: {mass_kg: 13.0}\n"
    )
    known = load_aircraft("aerosonde")
    aircraft = load_scenario(tmp_path / "scenario.yaml").aircraft
    assert aircraft == known.model_copy(update={"mass_kg": 13.0})


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "scenario.yaml:4: aircraft: {folder}/mine.yaml: no such file, and no bundled"),
        ("mass_kg: [\n", "scenario.yaml:4: aircraft: {folder}/mine.yaml"),
        ("extends: aerosonde\nmas_kg: 3\n", "mas_kg: unknown key; did you mean 'mass_kg'?"),
        ("extends: aerosonde\nmass_kg: -3\n", "mine.yaml:2: aircraft.mass_kg: expected > 0 kg"),
        ("extends: aerosond\n", "no bundled aircraft of that name; did you mean 'aerosonde'?"),
        ("extends: mine.yaml\n", "extends itself"),
    ],
)
def test_a_file_that_is_no_aircraft_is_refused(
    tmp_path: Path, content: str | None, expected: str
) -> None:
    if content is not None:
        (tmp_path / "mine.yaml").write_text(content)
    (tmp_path / "scenario.yaml").write_text(OF_THEIR_OWN)
    with pytest.raises(ConfigError) as refused:
        load_scenario(tmp_path / "scenario.yaml")
    assert expected.format(folder=tmp_path) in str(refused.value)

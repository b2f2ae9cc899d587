"""Scenarios by name: what is bundled, and what a name means."""

from pathlib import Path

import pytest

from gcs.scenario.bundled import SCENARIOS, addition_names, bundled_names, find_scenario
from gcs.scenario.model import Scenario, load_scenario
from gcs.scenario.profile_file import load_profile
from mavlink_defs.config.models import ConfigError


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_every_scenario_of_the_project_has_a_name() -> None:
    names = bundled_names()
    assert {"paper/scenario1", "faults/two_uavs"} <= set(names)
    assert "realistic" in addition_names()
    found = [find_scenario(name) for name in names + addition_names()]
    assert sorted(found) == sorted(SCENARIOS.rglob("*.yaml"))


@pytest.mark.parametrize("name", ["paper/scenario1", "paper/scenario1.yaml"])
def test_a_name_is_as_good_as_a_file(name: str, scenario1: Scenario) -> None:
    assert load_scenario(name) == load_scenario(Path(name)) == scenario1
    assert load_profile(name) == scenario1.segments()


def test_a_file_can_extend_a_bundled_scenario(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("extends: faults/two_uavs\nname: mine\n")
    mine = load_scenario("mine.yaml")
    assert mine.name == "mine"
    assert mine.faults == load_scenario("faults/two_uavs").faults
    assert load_profile("mine.yaml") == mine.segments()


def test_a_file_can_extend_a_scenario_and_an_addition(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("extends: [faults/two_uavs, realistic]\nname: mine\n")
    mine = load_scenario("mine.yaml")
    assert mine.faults == load_scenario("faults/two_uavs").faults
    assert mine.servos.surfaces.lag_s == 0.02


def test_a_folder_of_that_name_is_not_meant(tmp_path: Path) -> None:
    (tmp_path / "tube").mkdir()
    (tmp_path / "mine").mkdir()
    assert find_scenario("tube") == SCENARIOS / "tube.yaml"
    assert find_scenario("mine") == Path("mine")  # which cannot be read, as is reported then


def test_a_file_that_exists_is_meant_first(tmp_path: Path) -> None:
    own = tmp_path / "paper" / "scenario1.yaml"
    own.parent.mkdir()
    own.write_text("extends: faults/two_uavs\nname: mine\n")
    assert load_scenario("paper/scenario1.yaml").name == "mine"
    (tmp_path / "top.yaml").write_text("extends: paper/scenario1.yaml\n")
    assert load_scenario("top.yaml").name == "mine"


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("paper/scenario11", "paper/scenario1"),
        ("scenario2_pid", "paper/scenario2_pid"),
        ("scenarios/paper/scenario1.yaml", "paper/scenario1"),
    ],
)
def test_an_unknown_name_suggests_names_alike(name: str, meant: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=rf"^{name}: no such file.*; did you mean {meant}\b"):
        load_scenario(name)
    (tmp_path / "mine.yaml").write_text(f"extends: {name}\n")
    text = rf"^mine\.yaml:1: extends: {name}: .*did you mean {meant}"
    with pytest.raises(ConfigError, match=text):
        load_scenario("mine.yaml")


def test_a_name_like_no_other_gets_no_suggestion() -> None:
    with pytest.raises(ConfigError) as caught:
        load_scenario("qwertz.yaml")
    assert str(caught.value) == (
        "qwertz.yaml: no such file, and no bundled scenario of that name "
        "(`gcs scenarios` lists them)"
    )


def test_nobody_flies_surviving_by_thresholds_that_know_no_noise_without_asking() -> None:
    names = [name for name in bundled_names() if not name.startswith("campaigns/")]
    flown = [load_scenario(name) for name in names]
    modes = {s.name: s.trigger.mode for s in flown if s.controller.kind == "surviving"}
    assert len(modes) > 10
    assert set(modes.values()) == {"scaled"}
    assert load_scenario("paper/scenario1").trigger.mode == "per_channel", "as Table V counts"

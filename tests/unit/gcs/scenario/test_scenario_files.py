"""The scenarios that come with the project, and scenarios that extend others."""

import copy
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gcs.commands.common import changed_scenario
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from gcs.scenario.profile_file import load_profile
from mavlink_defs.config.inherit import merged, with_values
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of

SCENARIOS = Path(__file__).parents[4] / "scenarios"
CAMPAIGNS = sorted((SCENARIOS / "campaigns").iterdir())
FILES = [path for path in sorted(SCENARIOS.glob("*/**/*.yaml")) if path not in CAMPAIGNS]
ADDITIONS = sorted(SCENARIOS.glob("*.yaml"))
PAPER = SCENARIOS / "paper" / "scenario1.yaml"


def identify(path: Path) -> str:
    return str(path.relative_to(SCENARIOS).with_suffix(""))


def test_every_file_loads_and_says_what_it_shows(
    scenario1: Scenario, subtests: pytest.Subtests
) -> None:
    for path in FILES:
        with subtests.test(identify(path)):
            scenario = load_scenario(path)
            assert path.read_text().startswith("# ")
            assert path == PAPER or scenario.description != scenario1.description
            assert with_changes(scenario, (), {"name": scenario.name}, "changes") == scenario


@pytest.mark.parametrize("path", ADDITIONS, ids=identify)
def test_an_addition_changes_any_scenario_and_says_which_flight_it_is_not(path: Path) -> None:
    addition = scenario_tree(path)
    assert not {"name", "description", "extends", "faults", "uavs"} & addition.keys()
    for base in ("paper/scenario1", "faults/thrust_loss"):
        tree = merged(scenario_tree(base), addition)
        changed, plain = scenario_of(path, tree), load_scenario(base)
        assert changed != plain
        assert changed.faults == plain.faults


def test_names_are_unique() -> None:
    files = [*FILES, *CAMPAIGNS]
    names = [re.findall(r"^name: (.*)$", path.read_text(), re.MULTILINE) for path in files]
    assert all(len(found) == 1 for found in names)
    assert len({found[0] for found in names}) == len(names)


@pytest.mark.parametrize(
    ("mode", "fault"),
    [
        (1, ("rudder", 0.9, 0.0)),
        (2, ("rudder", 0.9, 1.0)),
        (3, ("elevator", 0.9, 0.5)),
        (4, ("aileron", 0.9, 1.0)),
    ],
)
def test_fault_modes_of_scenario_3_are_the_papers(
    scenario1: Scenario, mode: int, fault: tuple[str, float, float]
) -> None:
    scenario = load_scenario(SCENARIOS / "paper" / f"scenario3_mode{mode}.yaml")
    [(uav, found)] = scenario.fault_commands()
    assert (found.whose, found.effectiveness, found.value) == fault
    assert (uav, found.start_s, found.end_s) == (3, 19.0, 22.0)
    same = {key: getattr(scenario1, key) for key in ("name", "description", "faults")}
    assert scenario.model_copy(update=same) == scenario1


def test_faults_strike_the_papers_flight(scenario1: Scenario, subtests: pytest.Subtests) -> None:
    names = ("name", "description", "faults", "duration_s")
    same = {key: getattr(scenario1, key) for key in names}
    for path in sorted((SCENARIOS / "faults").iterdir()):
        with subtests.test(identify(path)):
            scenario = load_scenario(path)
            assert scenario.model_copy(update=same) == scenario1
            assert all(fault.start_s < scenario.duration_s for fault in scenario.faults)


def extending(folder: Path, text: str) -> Path:
    path = folder / "mine.yaml"
    path.write_text(f"extends: {PAPER}\n{text}")
    return path


def test_a_scenario_says_only_in_what_it_differs(tmp_path: Path, scenario1: Scenario) -> None:
    path = extending(
        tmp_path, "name: mine\naircraft: {mass_kg: 21}\ntrigger: {a2_n: 2}\nfaults: []"
    )
    mine = load_scenario(path)
    assert mine.name == "mine"
    assert mine.aircraft == scenario1.aircraft.model_copy(update={"mass_kg": 21.0})
    assert mine.trigger.a2_n.root == 2.0
    assert mine.trigger.b2_deg == scenario1.trigger.b2_deg
    assert mine.faults == ()
    assert mine.uavs == scenario1.uavs


def test_every_problem_is_reported_of_the_file_that_was_loaded(tmp_path: Path) -> None:
    path = extending(tmp_path, "aircraft: {mass_kg: -1, mass_g:  3}\nextend: other.yaml")
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert str(caught.value).splitlines() == [
        f"{path}:2: aircraft.mass_kg: expected > 0 kg, got -1",
        f"{path}:2: aircraft.mass_g: unknown key; did you mean 'mass_kg'?",
        f"{path}:3: extend: unknown key; did you mean 'extends'?",
    ]


def test_a_problem_is_reported_of_the_file_that_has_the_value(tmp_path: Path) -> None:
    base = extending(tmp_path, "seed: 1\naircraft:\n  mass_kg: -1\n").rename(tmp_path / "base.yaml")
    path = tmp_path / "mine.yaml"
    path.write_text(f"extends: {base}\ntrigger: {{b2_deg: -1}}\n")
    with pytest.raises(ConfigError) as caught:
        changed_scenario(path, ["realistic"], ["step_us=0"])
    assert str(caught.value).splitlines() == [
        "--set: step_us: expected [1, 100000] us, got 0",
        f"{base}:4: aircraft.mass_kg: expected > 0 kg, got -1",
        f"{path}:2: trigger.b2_deg: expected >= 0 deg, got -1",
    ]


def test_a_base_that_is_no_scenario_is_not_quoted(tmp_path: Path) -> None:
    secret = tmp_path / "secret.yaml"
    secret.write_text("name: production\npassword: hunter2\n")
    path = tmp_path / "mine.yaml"
    path.write_text("extends: secret.yaml\n")
    for read in (load_scenario, load_profile):
        with pytest.raises(ConfigError) as caught:
            read(path)
        assert str(caught.value) == f"{path}:1: extends: {secret}:2: unknown key"


def test_a_tree_has_everything_and_can_be_changed_before_it_is_checked(tmp_path: Path) -> None:
    path = extending(tmp_path, "name: mine")
    tree: dict[str, Any] = scenario_tree(path)
    assert "extends" not in tree
    assert scenario_of(path, tree) == load_scenario(path)
    values = {"trigger.b2_deg": 0.5, "controller.rbf.neurons": 20, "faults[0].effectiveness": 0.3}
    swept = scenario_of(path, with_values(tree, values))
    assert swept.trigger.b2_deg.root == 0.5
    assert swept.actuator_faults[0].effectiveness == 0.3
    with pytest.raises(ConfigError, match=r"mine\.yaml: trigger\.b2_deg: expected >= 0 deg, got"):
        scenario_of(path, with_values(tree, {"trigger.b2_deg": -1}))


def places(tree: Any, *at: Any) -> Iterator[tuple[Any, ...]]:
    """The place of every value in a tree."""
    if isinstance(tree, list):
        tree = dict(enumerate(tree))
    for key, value in tree.items() if isinstance(tree, dict) else ():
        yield (*at, key)
        yield from places(value, *at, key)


def test_a_value_of_a_wrong_kind_is_refused_wherever_it_stands() -> None:
    full = parse_yaml(yaml_of(load_scenario(PAPER).model_dump()))
    refused = set()
    for place in places(full):
        for wrong in ("abc", 1.5, -1, True, None, [], [1], {}, {"x": 1}, math.nan):
            tree = copy.deepcopy(full)
            node = tree
            for key in place[:-1]:
                node = node[key]
            node[place[-1]] = wrong
            try:
                scenario_of(PAPER, tree)
            except ConfigError:
                refused.add(place[0])
    assert refused == set(full)

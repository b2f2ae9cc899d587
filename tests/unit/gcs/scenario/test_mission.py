"""The section `mission` of a scenario."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from ftc_autopilot.common.geography import position_of
from gcs.scenario.model import Scenario, load_scenario
from gcs.scenario.profile_file import load_profile
from mavlink_defs import dialect
from mavlink_defs.config.files import dump, load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.mission_files import plan_text, waypoints_text
from mavlink_defs.profile import segments_to_items

OTHERS = Path(__file__).parents[3] / "data" / "others"
ITEMS: list[dict[str, Any]] = [
    {"waypoint": {"north_m": 3000.0, "east_m": 0.0, "height_m": 120.0, "within_m": 5.0}},
    {"speed": {"airspeed_m_s": 45.0}},
    {"loiter": {"north_m": 3000.0, "east_m": 3000.0, "height_m": 120.0, "turns": 2.0}},
    {"loiter": {"height_m": 120.0, "radius_m": -700.0, "time_s": 30.0}},
    {"home": {"north_m": 100.0, "east_m": 0.0}},
    {"delay": {"time_s": 5.0}},
    {"jump": {"to_item": 1, "times": 2}},
    {"item": {"command": 20, "params": [None, 1.0]}},
    {"return_to_launch": {}},
]


def written(folder: Path, tree: Any, mission: Any) -> Path:
    path = folder / "mine.yaml"
    kept = {key: value for key, value in tree.items() if key not in {"profile", "faults"}}
    path.write_text(yaml.safe_dump({**kept, "mission": mission}))
    return path


def contents(scenario: Scenario) -> list[tuple[Any, ...]]:
    return [
        (i.seq, i.command, i.frame, str(i.param1), i.param2, i.param3, i.x, i.y, i.z)
        for i in scenario.mission_items()
    ]


def test_each_entry_is_an_item_of_the_protocol(tree: Any, tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, tree, {"items": ITEMS}))
    home, *items = scenario.mission_items()
    assert (home.x, home.y, home.z) == (-353632620, 1491652370, 584.0)
    names = {value: name for name, value in vars(dialect).items() if name.startswith("MAV_CMD_")}
    assert [names[item.command].removeprefix("MAV_CMD_") for item in items] == [
        "NAV_WAYPOINT",
        "DO_CHANGE_SPEED",
        "NAV_LOITER_TURNS",
        "NAV_LOITER_TIME",
        "DO_SET_HOME",
        "CONDITION_DELAY",
        "DO_JUMP",
        "NAV_RETURN_TO_LAUNCH",
        "NAV_RETURN_TO_LAUNCH",
    ]
    assert [item.seq for item in items] == list(range(1, 10))
    assert scenario.segments() == ()
    assert scenario.mission is not None


def test_a_scenario_with_a_mission_is_written_and_read_again(tree: Any, tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, tree, {"items": ITEMS}))
    dump(scenario, tmp_path / "again.yaml")
    assert load(tmp_path / "again.yaml", Scenario) == scenario


@pytest.mark.parametrize(("name", "text_of"), [("a.plan", plan_text), ("a.txt", waypoints_text)])
def test_a_mission_file_beside_the_scenario(
    tree: Any, tmp_path: Path, name: str, text_of: Any
) -> None:
    scenario = load_scenario(written(tmp_path, tree, {"items": ITEMS}))
    (tmp_path / name).write_text(text_of(scenario.mission_items()))
    again = load_scenario(written(tmp_path, tree, {"file": name}))
    assert contents(again) == contents(scenario)


def test_a_mission_file_belongs_to_the_file_that_names_it(tree: Any, tmp_path: Path) -> None:
    """It replaces the items of what the file extends, and lies beside it, not beside others."""
    far = tmp_path / "far"
    far.mkdir()
    scenario = load_scenario(written(tmp_path, tree, {"items": ITEMS}))
    (far / "a.waypoints").write_text(waypoints_text(scenario.mission_items()))
    (far / "middle.yaml").write_text("extends: missions/hexagon\nmission: {file: a.waypoints}\n")
    (tmp_path / "top.yaml").write_text("extends: far/middle.yaml\nduration_s: 5\n")
    assert contents(load_scenario(tmp_path / "top.yaml")) == contents(scenario)
    (far / "a.waypoints").unlink()
    with pytest.raises(
        ConfigError, match=r"extends: .*mission\.file: .*a\.waypoints: no such file"
    ):
        load_scenario(tmp_path / "top.yaml")


def test_what_stands_beside_a_mission_file_is_named(tree: Any, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"here: true or false, got 'a\.plan' and items"):
        load_scenario(written(tmp_path, tree, {"file": "a.plan", "items": []}))


def test_a_mission_file_of_elsewhere_is_moved_to_the_origin(tree: Any, tmp_path: Path) -> None:
    """Also when the scenario is kept and read again, and whatever its origin is."""
    origin = {"latitude_deg": 60.0, "longitude_deg": 20.0, "altitude_m": 10.0}
    (tmp_path / "a.plan").write_text((OTHERS / "survey.plan").read_text())
    mission = {"file": "a.plan", "here": True}
    scenario = load_scenario(written(tmp_path, {**tree, "origin": origin}, mission))
    home, _, first, *_ = scenario.mission_items()
    assert (home.x, home.y) == (600000000, 200000000)
    assert position_of(scenario.origin, first.x, first.y) == pytest.approx((200.0, 0.0), abs=0.1)
    dump(scenario, tmp_path / "again.yaml")
    assert contents(load_scenario(tmp_path / "again.yaml")) == contents(scenario)


@pytest.mark.parametrize(
    ("guidance", "problem"),
    [
        (
            {"cruise_m_s": 80.0},
            "guidance.cruise_m_s: expected [30, 60] m/s, the limits of guidance and aircraft, "
            "got 80.0",
        ),
        (
            {"airspeed_min_m_s": 50.0, "airspeed_max_m_s": 45.0},
            "guidance.airspeed_min_m_s: expected <= 45 m/s, airspeed_max_m_s, got 50.0",
        ),
    ],
)
def test_airspeeds_of_guidance(
    tree: Any, tmp_path: Path, guidance: dict[str, float], problem: str
) -> None:
    with pytest.raises(ConfigError) as error:
        load_scenario(written(tmp_path, {**tree, "guidance": guidance}, {"items": ITEMS}))
    assert [str(p) for p in error.value.problems] == [problem]


def test_a_profile_is_replaced_by_a_mission(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    changes = {"profile": None, "faults": None, "mission": {"items": ITEMS[:1]}}
    path.write_text(yaml.safe_dump({"extends": "paper/scenario1", **changes}))
    assert load_scenario(path).profile == ()


@pytest.mark.parametrize(
    ("mission", "problem"),
    [
        (
            {"items": [{"waypoint": {"north_m": 2e3, "east_m": 0.0, "height_m": -5.0}}]},
            "mission.items[0]: altitude is -5 m above home, must be 0 to 10000 m",
        ),
        ({"items": []}, "mission.items: expected at least 1 entry, got a list of 0"),
        ({"items": [{}]}, "mission.items[0]: expected one of the keys waypoint, loiter, "),
        (
            {"items": [ITEMS[0] | ITEMS[1]]},
            "mission.items[0]: expected one of the keys waypoint, loiter, take_off, land, "
            "speed, delay, jump, home, return_to_launch, item, got waypoint and speed",
        ),
        ({"items": ITEMS[1:2]}, "mission.items[0]: no waypoint or circle follows"),
        (
            {"items": [{"loiter": {"north_m": 1.0, "height_m": 1.0}}]},
            "mission.items[0].loiter: expected north_m and east_m or none of them",
        ),
        (
            {"items": [{"loiter": {"height_m": 1.0, "turns": 1.0, "time_s": 1.0}}]},
            "mission.items[0].loiter: expected turns or time_s, got both",
        ),
        (
            {"items": [{"item": {"command": 21}}]},
            "mission.items[0]: the aircraft has no gear to land on",
        ),
        ({"file": "none.plan"}, "mission.file: "),
        ({"file": 3}, "mission.file: expected the name of a mission file, and no key beside it"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(
    tree: Any, tmp_path: Path, mission: Any, problem: str
) -> None:
    with pytest.raises(ConfigError) as error:
        load_scenario(written(tmp_path, tree, mission))
    assert str(error.value.problems[0]).startswith(problem)


def test_a_profile_and_a_mission_are_one_too_many(tree: Any, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**tree, "mission": {"items": ITEMS}}))
    with pytest.raises(ConfigError, match="mission: expected a profile or a mission, got both"):
        load_scenario(path)


def test_a_mission_file_can_hold_a_profile(scenario1: Scenario, tmp_path: Path) -> None:
    path = tmp_path / "profile.waypoints"
    path.write_text(waypoints_text(segments_to_items(scenario1.segments(), 1, 1)))
    assert load_profile(path) == scenario1.segments()
    path.write_text(waypoints_text(segments_to_items((), 1, 1)))
    with pytest.raises(ConfigError, match="Mission has no segment, needs 1"):
        load_profile(path)


def test_a_path_is_no_profile(tree: Any, tmp_path: Path) -> None:
    mine = written(tmp_path, tree, {"items": ITEMS})
    with pytest.raises(ConfigError, match="has a mission, no profile; see gcs mission"):
        load_profile(mine)
    scenario = load_scenario(mine)
    path = tmp_path / "path.plan"
    path.write_text(plan_text(scenario.mission_items()))
    with pytest.raises(ConfigError, match="holds a path, not a profile"):
        load_profile(path)

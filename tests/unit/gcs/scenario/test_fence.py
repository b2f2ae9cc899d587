"""The sections `fence` and `rally`: what they upload, what is refused, what is remarked on."""

import shutil
from pathlib import Path

import pytest
import yaml

from gcs.fleet.preparation import IN_PROCESS, How
from gcs.fleet.remarks import WarningRemark, remarks_of
from gcs.scenario.itinerary import load_areas
from gcs.scenario.model import Scenario, read_scenario
from mavlink_defs.config.models import ConfigError

OTHERS = Path(__file__).parents[3] / "data" / "others"
HOW_TO = Path(__file__).parents[4] / "docs" / "how-to" / "fence.md"


def scenario(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "mine.yaml"
    path.write_text(f"extends: paper/scenario1\n{text}")
    return read_scenario(path)


CIRCLE = "fence: {items: [{circle: {north_m: 0, east_m: 0, radius_m: 900}}]}\n"
AROUND_A_WAYPOINT = (
    "profile: null\nfaults: null\n"
    "mission: {items: [{waypoint: {north_m: 2000, east_m: 0, height_m: 100}}]}\n"
)


def test_sections_become_items_and_parameters(tmp_path: Path) -> None:
    text = """
fence:
  action: guided
  margin_m: 5
  items:
    - polygon:
        inclusion: false
        corners:
          - {north_m: 500, east_m: 0}
          - {north_m: 500, east_m: 100}
          - {north_m: 600, east_m: 0}
    - circle: {north_m: 0, east_m: 0, radius_m: 900}
    - return_point: {north_m: 100, east_m: 0}
rally:
  incl_home: true
  items:
    - point: {north_m: 100, east_m: 200, height_m: 90}
    - item: {command: 5100, x: -353632620, y: 1491652370, z: 80}
"""
    made = scenario(tmp_path, text)
    fence, rally = made.areas()
    assert [(i.seq, i.command, i.param1) for i in fence] == [
        (0, 5002, 3.0),
        (1, 5002, 3.0),
        (2, 5002, 3.0),
        (3, 5003, 900.0),
        (4, 5000, 0.0),
    ]
    assert [(i.seq, i.command, i.z, i.frame) for i in rally] == [
        (0, 5100, 90.0, 3),
        (1, 5100, 80.0, 3),
    ]
    config = made.autopilot_config(2)
    assert (config.fence.enable, config.fence.action, config.fence.margin_m) == (True, "guided", 5)
    assert config.rally.incl_home
    assert load_areas(tmp_path / "mine.yaml") is not None
    again = Scenario.model_validate(made.model_dump())
    assert again.areas()[0][3].param1 == 900.0


def test_without_sections_nothing_is_watched_or_uploaded(scenario1: Scenario) -> None:
    assert scenario1.areas() == ((), ())
    assert not scenario1.autopilot_config(1).fence.enable


def test_a_plan_gives_areas(tmp_path: Path) -> None:
    shutil.copy(OTHERS / "fence_and_rally.plan", tmp_path / "a.plan")
    made = scenario(tmp_path, "fence: {file: a.plan, action: report}\nrally: {file: a.plan}\n")
    fence, rally = made.areas()
    assert [(i.command, i.param1) for i in fence] == [(5003, 300.0)]
    assert [i.command for i in rally] == [5100]
    assert made.autopilot_config(1).fence.action == "report"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "fence: {items: [{circle: {north_m: 0, east_m: 0, radius_m: 90, inclusion: false}}]}",
            "fence.items[0]: home is 90 m within the exclusion circle of item 0",
        ),
        (
            "fence: {items: [{circle: {north_m: 0, east_m: 0, radius_m: 9e4}}, {polygon: {corners: "
            "[{north_m: 0, east_m: 9}, {north_m: 9, east_m: 9}, {north_m: 9, east_m: 18}]}}]}",
            "fence.items[1]: home is 9 m outside the inclusion polygon of item 1",
        ),
        ("fence: {}", "fence: expected an area, or a type that watches heights, as it is enabled"),
        ("fence: {type: 8, alt_min_m: 500}", "uavs[0].initial: outside the fence: below 500 m"),
        (
            "fence: {items: [{circle: {north_m: 0, east_m: 0, radius_m: 15}}]}",
            "uavs[0].initial: outside the fence: outside the inclusion circle of item 0",
        ),
        ("fence: {action: hover}", "fence.action: expected 'report', 'rtl', 'loiter', 'guided'"),
        (
            "fence: {items: [{circle: {north_m: 0, east_m: 0, radius_m: 9}, item: {command: 1}}]}",
            "fence.items[0]: expected one of the keys polygon, circle, return_point, item, got",
        ),
        (
            "rally: {items: [{point: {north_m: 0, east_m: 0, height_m: -5}}]}",
            "rally.items[0]: altitude is -5 m above home, must be 0 to 10000 m",
        ),
        ("fence: {file: nope.plan}", "fence.file: "),
        ("fence: {file: 7}", "fence.file: expected the name of a plan"),
        ("rally: {file: a.plan, items: []}", "and no items beside it, got 'a.plan' and items"),
        ("rally: {file: none.plan}", "rally.file: expected a plan with rally points, got"),
    ],
)
def test_what_cannot_be_a_fence_is_refused_before_the_flight(
    text: str, expected: str, tmp_path: Path
) -> None:
    (tmp_path / "none.plan").write_text(PLAN)
    with pytest.raises(ConfigError) as caught:
        scenario(tmp_path, text)
    assert expected in str(caught.value)


PLAN = """{"fileType": "Plan", "mission": {"plannedHomePosition": [-35.3, 149.1, 584],
"items": []}}"""


def test_a_mission_that_leaves_the_fence_is_remarked_on(tmp_path: Path) -> None:
    remark = "the mission leaves the fence on the way to item 1: a breach there is followed by rtl"
    found = [r for r in remarks_of(scenario(tmp_path, CIRCLE + AROUND_A_WAYPOINT)) if remark in r]
    assert len(found) == 1
    assert isinstance(found[0], WarningRemark)
    wide = CIRCLE.replace("900", "5000") + AROUND_A_WAYPOINT
    off = CIRCLE.replace("{items", "{enable: false, items") + AROUND_A_WAYPOINT
    for text in (wide, off):
        assert not [r for r in remarks_of(scenario(tmp_path, text)) if "fence" in r]


def test_a_flight_in_process_watches_no_fence(tmp_path: Path, scenario1: Scenario) -> None:
    fenced = scenario(tmp_path, CIRCLE)
    assert any("nobody watches the fence" in remark for remark in IN_PROCESS.remarks(fenced))
    assert not any("fence" in remark for remark in IN_PROCESS.remarks(scenario1))
    assert not any("fence" in remark for remark in How(free_ports=True).remarks(fenced))


def test_the_example_of_the_documentation(tmp_path: Path) -> None:
    _, text, _ = HOW_TO.read_text().split("```", 2)
    path = tmp_path / "mine.yaml"
    path.write_text(text.removeprefix("yaml"))
    made = read_scenario(path)
    assert yaml.safe_load(text.removeprefix("yaml"))["name"] == made.name
    assert not [remark for remark in remarks_of(made) if "fence" in remark]

"""``gcs mission show``: what it tells before a flight, and what it refuses as a vehicle would."""

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ftc_autopilot.common.geography import Origin, place_of
from gcs.commands.cli import app
from gcs.results.mission_paths import paths_of
from gcs.scenario.itinerary import dry_run, load_mission, outline
from gcs.scenario.mission import MissionSection
from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.config.models import ConfigError
from mavlink_defs.mission_files import mission_item, plan_text, waypoints_text
from mavlink_defs.services.mission import MissionItem

OTHERS = Path(__file__).parents[3] / "data" / "others"


def items(*places: tuple[float, float], last: MissionItem | None = None) -> list[MissionItem]:
    """Waypoints north and east of home [m], 300 m high."""
    home = place_of(Origin(), 0.0, 0.0, 0.0)
    made = [mission_item(0, dialect.MAV_CMD_NAV_WAYPOINT, (), *home[:2], 584.0, 0)]
    for seq, (north, east) in enumerate(places, start=1):
        place = place_of(Origin(), north, east, 0.0)
        made.append(mission_item(seq, dialect.MAV_CMD_NAV_WAYPOINT, (), *place[:2], 300.0))
    return made if last is None else [*made, last]


def show(path: Path, *options: str) -> tuple[int, str]:
    result = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(
        app, ["mission", "show", str(path), *options]
    )
    if isinstance(result.exception, ConfigError):
        return 2, str(result.exception)
    assert result.exit_code == 0, result.exception
    return 0, result.stdout


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_lengths_turns_and_times(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"corner{suffix}"
    mission = items((2000.0, 0.0), (2000.0, 3000.0))
    path.write_text(plan_text(mission) if suffix == ".plan" else waypoints_text(mission))
    status, text = show(path, "--json")
    assert status == 0
    shown = json.loads(text)
    first, second = shown["stages"]
    radius = 40.0**2 / (9.8 * math.tan(math.radians(20.0)))  # 20° of bank
    assert first["turn_radius_m"] == pytest.approx(radius)
    corner = radius * (1.0 - math.pi / 4.0)  # saved by half the turn inside the corner
    assert first["length_m"] == pytest.approx(2000.0 - corner, abs=0.1)
    assert first["time_s"] == pytest.approx(first["length_m"] / 40.0)
    assert second["length_m"] == pytest.approx(3000.0 - corner, abs=0.1)
    assert shown["repeats"] is None
    assert shown["length_m"] == pytest.approx(first["length_m"] + second["length_m"])
    status, text = show(path)
    assert "2000" not in text.splitlines()[1].split()[2:4]  # the turn is inside the corner
    assert text.splitlines()[-1].endswith("circles around the last place")


def test_what_a_vehicle_would_refuse_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "lands.plan"
    land = mission_item(2, dialect.MAV_CMD_NAV_LAND)
    path.write_text(plan_text(items((2000.0, 0.0), last=land)))
    reason = "the aircraft has no gear to land on; add `gear: {kind: tricycle}` to it, or"
    assert show(path) == (2, f"{path}: Item 2: {reason} `{{kind: belly}}`")
    path.write_text("{}")
    status, text = show(path)
    assert (status, text.startswith(f"{path}: ")) == (2, True)
    assert show(tmp_path / "none.plan")[0] == 2


def test_a_plan_that_begins_with_a_takeoff_is_shown_without_a_way_to_it(tmp_path: Path) -> None:
    home, *places = items((2000.0, 0.0), (2000.0, 3000.0))
    takeoff = mission_item(1, dialect.MAV_CMD_NAV_TAKEOFF, (15.0, 0.0, 0.0, math.nan), 0, 0, 50.0)
    for item in places:
        item.seq += 1
    path = tmp_path / "survey.plan"
    path.write_text(plan_text([home, takeoff, *places]))
    shown = json.loads(show(path, "--json")[1])
    assert [stage["item"] for stage in shown["stages"]] == [2, 3]
    assert shown["items"][0] == {"item": 1, "text": "takeoff"}
    assert "takeoff" in show(path)[1]


def test_an_aircraft_that_stands_is_shown_from_its_runway_on() -> None:
    """Its take-off had no numbers, and the heights began in the air."""
    shown = json.loads(show(Path("runway/circuit"), "--json")[1])
    assert [stage["item"] for stage in shown["stages"]] == [1, 2, 3, 4, 5, 6]
    (way, begin), *_, (_, end) = shown["profile"]
    assert way == 0.0
    assert 0.0 < begin < 1.0
    assert begin == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize("low", ["-5", "-50"])
def test_places_below_home_are_refused_unless_the_scenario_permits_them(
    tmp_path: Path, low: str
) -> None:
    path, fleet = tmp_path / "low.waypoints", tmp_path / "valley.yaml"
    mission = items((2000.0, 0.0), (2000.0, 3000.0))
    mission[2].z = -20.0
    mission[1].z = 0.0
    path.write_text(waypoints_text(mission))
    text = "Item 2: altitude is -20 m above home, must be 0 to 10000 m"
    assert show(path) == (2, f"{path}: {text}")
    fleet.write_text(f"extends: paper/scenario1\nguidance: {{min_altitude_m: {low}}}\n")
    assert show(path, "--fleet", str(fleet))[0] == (2 if low == "-5" else 0)


def test_the_fleet_decides_what_can_be_flown(tmp_path: Path) -> None:
    path, fleet = tmp_path / "fast.waypoints", tmp_path / "slow.yaml"
    fast = mission_item(2, dialect.MAV_CMD_DO_CHANGE_SPEED, (0.0, 55.0, -1.0))
    path.write_text(waypoints_text(items((2000.0, 0.0), last=fast)))
    fleet.write_text("extends: paper/scenario1\naircraft: {airspeed_max_m_s: 50.0}\n")
    assert json.loads(show(path, "--json")[1])["remarks"] == []
    status, text = show(path, "--fleet", str(fleet))
    assert status == 0
    assert "item 2: airspeed 55, must be 23.72 to 47.43 m/s; 47.43 m/s is flown" in text


def test_a_race_track_repeats() -> None:
    fleet = load_scenario("missions/hexagon")
    itinerary = dry_run("hexagon", load_mission("missions/hexagon")[0], fleet)
    assert itinerary.repeats == 1
    assert {stage.item for stage in itinerary.stages} == {1, 2, 3, 4, 5, 6}


def test_the_outline_of_a_path_follows_its_arcs() -> None:
    scenario = load_scenario("missions/hexagon")
    paths = paths_of(scenario)
    assert paths is not None
    corners = outline(paths[0])
    assert corners[0][:2] == pytest.approx((0.0, 0.0))
    longest = max(math.dist(a[:2], b[:2]) for a, b in pairwise(corners))
    assert longest < 800.0
    heading = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(corners)]
    turns = [abs(math.remainder(b - a, 2.0 * math.pi)) for a, b in pairwise(heading)]
    assert max(turns) < math.radians(6.0)


FENCE = OTHERS / "fence_and_rally.plan"
TOLD = "a cruise speed of 15 m/s"
LEFT = "a fence (the key fence takes it), 1 rally point (the key rally takes them), "


def test_what_vehicles_do_not_take_of_a_plan_is_told(tmp_path: Path) -> None:
    """In one line, whether the plan is named or a scenario names it, and as JSON."""
    copy, scenario = tmp_path / "fence.plan", tmp_path / "mine.yaml"
    copy.write_text(FENCE.read_text())
    scenario.write_text("extends: paper/scenario1\nprofile: null\nmission: {file: fence.plan}\n")
    for file in (FENCE, scenario):
        plan = FENCE if file == FENCE else copy
        result = CliRunner().invoke(app, ["mission", "show", str(file), "--json"])
        assert result.exit_code == 0, result.output
        [line] = result.stderr.splitlines()
        told = TOLD if file == FENCE else LEFT + TOLD
        assert line.startswith(f"{plan}: not flown: {told}")
        assert json.loads(result.stdout)["not_flown"][0] == told.partition(", ")[0]
    # what has nothing else is told of nothing
    copy.write_text(plan_text(items((2000.0, 0.0))))
    result = CliRunner().invoke(app, ["mission", "show", str(copy), "--json"])
    assert (result.stderr, json.loads(result.stdout)["not_flown"]) == ("", [])


def test_fence_and_rally_points_are_drawn_and_said(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["mission", "show", str(FENCE)])
    assert result.exit_code == 0, result.output
    for line in (
        "fence: inclusion circle of item 0",
        "the mission leaves the fence on the way to item 1",
        "R: 1 rally point",
    ):
        assert line in result.stdout.splitlines()
    drawn = [line for line in result.stdout.splitlines() if "│" in line or "┤" in line]
    assert len(drawn) > 15
    assert all(sum(mark in line for line in drawn) >= 1 for mark in "RH14⡇")
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(
        f"extends: paper/scenario1\nprofile: null\nmission: {{file: {FENCE}}}\n"
        f"fence: {{file: {FENCE}, action: report}}\nrally: {{file: {FENCE}}}\n"
    )
    shown = CliRunner().invoke(app, ["mission", "show", str(scenario)])
    assert shown.stdout == result.stdout
    assert "fence" not in shown.stderr


def test_a_fence_that_vehicles_refuse_is_refused(tmp_path: Path) -> None:
    plan = json.loads(FENCE.read_text())
    plan["geoFence"]["circles"][0]["circle"]["center"] = [-35.0, 149.1652]
    path = tmp_path / "far.plan"
    path.write_text(json.dumps(plan))
    status, text = show(path)
    assert status == 2
    assert text == f"{path}: fence: Item 0: home is 40138 m outside the inclusion circle of item 0"


def test_a_scenario_keeps_nothing_of_what_is_told() -> None:
    """Run folders, digests and reproductions know items alone."""
    section = MissionSection.model_validate(
        {"items": [{"return_to_launch": {}}], "not_flown": ["a fence"]}
    )
    assert "not_flown" not in section.model_dump()


@pytest.mark.parametrize("name", ["mission.txt", "mission", "mission.list"])
def test_a_mission_is_told_by_what_it_begins_with(name: str, tmp_path: Path) -> None:
    path, plan = tmp_path / name, tmp_path / f"{name}.waypoints"
    for file in (path, plan):
        file.write_text(waypoints_text(items((2000.0, 0.0), (2000.0, 3000.0))))
    assert show(path) == show(plan)
    with pytest.raises(ConfigError, match="a mission, not a scenario"):
        load_scenario(path)


@pytest.mark.parametrize(
    ("command", "advice"),
    [
        (93, "NAV_LOITER_TIME"),
        (94, "DO_GRIPPER"),
        (30, "NAV_LOITER_TO_ALT"),
        (186, "give the next place"),
        (224, "DO_JUMP"),
    ],
)
def test_what_is_refused_says_what_to_do(command: int, advice: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(waypoints_text(items((2000.0, 0.0), last=mission_item(2, command))))
    status, text = show(path)
    assert (status, text.startswith(f"{path}: Item 2: command {command}")) == (2, True)
    assert advice in text


@pytest.mark.parametrize("name", ["payload.waypoints", "survey.plan"])
def test_a_mission_of_elsewhere_is_shown_here(name: str) -> None:
    fleet = ("--fleet", "airframes/skywalker_x8")
    status, text = show(OTHERS / name, *fleet)
    assert (status, "; to fly it here, gcs mission has --here" in text) == (2, True)
    status, text = show(OTHERS / name, *fleet, "--here", "--json")
    assert status == 0
    shown = json.loads(text)
    if name == "payload.waypoints":
        assert [one["item"] for one in shown["passed"]] == [1, 3, 5, 7, 1, 3, 5, 7, 11]
        assert shown["remarks"] == [
            "1 spline or arc flown as waypoint, on a line",
            "1 altitude above terrain counted from home: the ground is flat",
            "4 payload commands announced only",
        ]
    else:
        passed = [one for one in shown["passed"] if one["item"] == 3]
        assert passed[0]["north_m"] == pytest.approx(200.0, abs=1.0)
    ways, heights = zip(*shown["profile"], strict=True)
    assert list(ways) == sorted(ways)
    assert max(heights) == (180.0 if name == "payload.waypoints" else 100.0)
    assert ways[-1] == pytest.approx(shown["length_m"])


def test_the_profile_names_the_items_below_it(tmp_path: Path) -> None:
    status, text = show(OTHERS / "payload.waypoints", "--here", "--fleet", "airframes/skywalker_x8")
    assert status == 0
    lines = text.splitlines()
    title = next(k for k, line in enumerate(lines) if "height [m] at each item" in line)
    drawn = lines[title + 1 : title + 12]
    assert any("180" in line for line in drawn)
    assert {"2", "6", "8", "10"} <= set(drawn[-1].split())
    assert "x1b" not in text
    assert "DO_SET_SERVO 9 1500" in text
    assert "4 payload commands announced only" in lines

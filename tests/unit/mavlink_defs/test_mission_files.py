"""Mission files of ground stations: what we write is read back, by us and by pymavlink."""

import contextlib
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavwp

from mavlink_defs import dialect
from mavlink_defs.config.models import ConfigError
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.mission_files import (
    MAX_NOT_FLOWN,
    MissionFile,
    is_mission_file,
    mission_item,
    plan_text,
    read_mission_file,
    waypoints_text,
)
from mavlink_defs.plan_items import simple_items
from mavlink_defs.services.mission import MissionItem

OTHERS = Path(__file__).parents[2] / "data" / "others"

numbers = st.floats(-1000.0, 1000.0, width=32).map(decimal_of_float32).map(lambda x: round(x, 3))
items = st.builds(
    mission_item,
    st.just(0),
    st.sampled_from([16, 17, 18, 19, 20, 177, 178, 179]),
    st.tuples(numbers, numbers, numbers, numbers),
    st.integers(-(90 * 10**7), 90 * 10**7),
    st.integers(-(180 * 10**7), 180 * 10**7),
    numbers,
    st.sampled_from([0, 3, 5, 6]),
)
home = items.filter(lambda item: item.command != dialect.MAV_CMD_DO_JUMP)
missions = st.builds(lambda first, others: [first, *others], home, st.lists(items, max_size=4))


def numbered(listed: list[MissionItem]) -> tuple[MissionItem, ...]:
    for seq, item in enumerate(listed):
        item.seq = seq
        if item.command == dialect.MAV_CMD_DO_JUMP:  # to an item that there is, not home
            item.param1 = float(1 + seq % max(len(listed) - 1, 1))
    return tuple(listed)


def contents(listed: Any) -> list[tuple[float, ...]]:
    return [
        (i.seq, i.command, i.frame, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z)
        for i in listed
    ]


def read(text: str, folder: Path, name: str = "mission.waypoints") -> tuple[MissionItem, ...]:
    path = folder / name
    path.write_text(text)
    return read_mission_file(path).items


@given(missions)
def test_a_waypoint_list_comes_back(
    tmp_path_factory: pytest.TempPathFactory, listed: list[MissionItem]
) -> None:
    mission = numbered(listed)
    again = read(waypoints_text(mission), tmp_path_factory.mktemp("files"))
    for ours, theirs in zip(contents(mission), contents(again), strict=True):
        assert theirs == pytest.approx(ours, abs=1e-6)


@given(missions)
def test_a_plan_comes_back(
    tmp_path_factory: pytest.TempPathFactory, listed: list[MissionItem]
) -> None:
    mission = numbered(listed)
    again = read(plan_text(mission), tmp_path_factory.mktemp("files"), "mission.plan")
    for ours, theirs in zip(contents(mission)[1:], contents(again)[1:], strict=True):
        assert theirs == pytest.approx(ours, abs=1e-6)
    assert (again[0].x, again[0].y) == (mission[0].x, mission[0].y)


def test_pymavlink_reads_what_we_write(tmp_path: Path) -> None:
    home = mission_item(0, 16, (), -353632620, 1491652370, 584.0, 0)
    mission = (home, mission_item(1, 16, (0.0, 5.0), -353500000, 1491700000, 100.0))
    path = tmp_path / "ours.waypoints"
    path.write_text(waypoints_text(mission))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == 2
    waypoint = loader.item(1)
    assert (waypoint.command, waypoint.frame, waypoint.param2, waypoint.z) == (16, 3, 5.0, 100.0)
    assert (waypoint.x, waypoint.y) == pytest.approx((-35.35, 149.17), abs=1e-7)
    loader.save(str(tmp_path / "theirs.waypoints"))
    again = read_mission_file(tmp_path / "theirs.waypoints").items
    assert contents(again)[1] == pytest.approx(contents(mission)[1], abs=1e-4)


PLAN: dict[str, Any] = {
    "fileType": "Plan",
    "geoFence": {"circles": [], "polygons": [], "version": 2},
    "groundStation": "QGroundControl",
    "mission": {
        "cruiseSpeed": 15,
        "firmwareType": 3,
        "hoverSpeed": 5,
        "items": [
            {
                "AMSLAltAboveTerrain": None,
                "Altitude": 50,
                "AltitudeMode": 1,
                "autoContinue": True,
                "command": 16,
                "doJumpId": 1,
                "frame": 3,
                "params": [0, 0, 0, None, -35.36, 149.17, 50],
                "type": "SimpleItem",
            }
        ],
        "plannedHomePosition": [-35.363262, 149.165237, 584],
        "vehicleType": 1,
        "version": 2,
    },
    "rallyPoints": {"points": [], "version": 2},
    "version": 1,
}


def test_a_plan_of_qgroundcontrol(tmp_path: Path) -> None:
    home, waypoint = read(json.dumps(PLAN), tmp_path, "of_qgc.plan")
    assert (home.x, home.y, home.z) == (-353632620, 1491652370, 584.0)
    assert (waypoint.seq, waypoint.command, waypoint.frame) == (1, 16, 3)
    assert (waypoint.x, waypoint.y, waypoint.z) == (-353600000, 1491700000, 50.0)
    assert math.isnan(waypoint.param4)


def plan(**changes: Any) -> str:
    return json.dumps({**PLAN, "mission": {**PLAN["mission"], **changes}})


LINE = "0\t1\t0\t16\t0\t0\t0\t0\t-35.3\t149.1\t584\t1\n"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "expected a plan (JSON), or 'QGC WPL 110' in the first line"),
        ("QGC WPL 120\n", "expected a plan (JSON), or 'QGC WPL 110' in the first line"),
        ("QGC WPL 110\n", "expected home as item 0, got no item"),
        ("QGC WPL 110\n0 1 2\n", "item 0: expected 12 columns, got 3"),
        (f"QGC WPL 110\n{LINE.replace('16', 'x')}", "item 0: expected a whole number, got 'x'"),
        (f"QGC WPL 110\n{LINE.replace('149.1', 'x')}", "waypoints: item 0: expected a number, got"),
        (f"QGC WPL 110\n{LINE.replace('149.1', '1e99')}", "waypoints: item 0: expected numbers w"),
        (plan(plannedHomePosition=[0, 0, 10**400]), "expected numbers within 1e+38, got 1000"),
        (f"QGC WPL 110\n{LINE.replace('149.1', '1e9')}", "item 0: expected degrees, got -35.3"),
        (f"QGC WPL 110\n{LINE.replace('16', '70000')}", "item 0: there is no command 70000"),
        ("{", "is no JSON: "),
        ("{}", "expected a plan with fileType 'Plan' and a mission"),
        (plan(items=None), "mission.items: expected a list"),
        (
            plan(items=[{"type": "ComplexItem", "complexItemType": "survey"}]),
            "mission.items[0]: 'survey' carries no TransectStyleComplexItem.Items to be flown; sav",
        ),
        (plan(items=[{"type": "ComplexItem"}]), "expected a SimpleItem or a ComplexItem, got som"),
        (
            plan(items=[{"complexItemType": "fwLandingPattern", "landCoordinate": [1, 2, 3]}]),
            "mission.items[0]: expected landingApproachCoordinate (or loiterCoordinate) and landC",
        ),
        ('{"items": [], "complexItems": [{}]}', "complexItems: a .mission has no items of them"),
        (plan(items=[{"type": "SimpleItem", "params": []}]), "expected 7 numbers, got 0"),
        (
            plan(items=[{"type": "SimpleItem", "params": [0] * 7, "frame": 3}]),
            "mission.items[0].command: expected a whole number, got None",
        ),
        (
            plan(items=[{"type": "SimpleItem", "params": ["a"] * 7, "frame": 3, "command": 1}]),
            "mission.items[0].params: expected numbers, got 'a'",
        ),
        (plan(plannedHomePosition=None), "mission.plannedHomePosition: expected 3 numbers, got 0"),
    ],
)
def test_what_is_wrong_is_named(text: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=re.escape(problem)) as error:
        read(text, tmp_path)
    assert str(error.value).count("\n") == 0
    assert "mission.waypoints: " in str(error.value)


@given(st.text() | st.just("QGC WPL 110\n").flatmap(lambda head: st.text().map(head.__add__)))
def test_no_text_is_too_strange(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("strange") / "x.plan"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(ConfigError):
        read_mission_file(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_mission_file(tmp_path / "none.plan")


@pytest.mark.parametrize(
    ("name", "expected"), [("a.plan", True), ("a.WAYPOINTS", True), ("a.yaml", False)]
)
def test_files_that_are_not_there_are_known_by_name(name: str, expected: bool) -> None:
    assert is_mission_file(Path(name)) is expected


@pytest.mark.parametrize("name", ["a.txt", "a", "a.yaml", "a.json"])
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"QGC WPL 110\n{LINE}", True),
        (f"\ufeff\n QGC WPL 110\n{LINE}", True),
        (json.dumps(PLAN), True),
        (json.dumps({"mission": PLAN["mission"], "fileType": "Plan"}, indent=4), True),
        ('{"extends": "paper/scenario1"}', False),
        ("{mission: {items: []}}", False),
        ("", False),
        ("name: QGC WPL 110", False),
    ],
)
def test_files_are_known_by_what_they_begin_with(
    name: str, text: str, expected: bool, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    assert is_mission_file(tmp_path / name) is expected


def jumping(ids: list[int | None], target: float) -> str:
    """A plan of waypoints with such ids, and a jump at the end."""
    (waypoint,) = PLAN["mission"]["items"]
    items = [{k: v for k, v in waypoint.items() if k != "doJumpId"} for _ in ids]
    for item, name in zip(items, ids, strict=True):
        item.update({} if name is None else {"doJumpId": name})
    jump = {**waypoint, "command": 177, "params": [target, 2, 0, 0, 0, 0, 0], "doJumpId": 10**6}
    return plan(items=[*items, jump])


@given(st.lists(st.none() | st.integers(1, 9), min_size=1, max_size=5), st.integers(0, 12))
def test_a_jump_of_a_plan_goes_to_the_item_with_that_id(
    tmp_path_factory: pytest.TempPathFactory, ids: list[int | None], target: int
) -> None:
    """An item without one has its place as id; what no item, or several, are called is refused."""
    folder = tmp_path_factory.mktemp("jumps")
    named = [k if name is None else name for k, name in enumerate(ids, start=1)]
    if named.count(target) != 1:
        with pytest.raises(ConfigError, match=f"jumps to doJumpId {target}, which"):
            read(jumping(ids, target), folder, "a.plan")
        return
    items = read(jumping(ids, target), folder, "a.plan")
    assert items[-1].param1 == 1 + named.index(target)
    assert [item.seq for item in items] == list(range(len(ids) + 2))


@given(st.lists(st.integers(0, 9), min_size=1, max_size=5), st.integers(0, 9))
def test_a_jump_of_a_list_goes_to_the_line_with_that_number(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[int], target: int
) -> None:
    folder = tmp_path_factory.mktemp("jumps")
    lines = [f"{n}{LINE[1:]}" for n in numbers]
    text = "".join(["QGC WPL 110\n", *lines, f"99 0 3 177 {target} 2 0 0 0 0 0 1\n"])
    if numbers.count(target) != 1:
        with pytest.raises(ConfigError, match=f"jumps to the number {target}, which"):
            read(text, folder)
        return
    items = read(text, folder)
    assert items[-1].param1 == numbers.index(target)
    assert [item.seq for item in items] == list(range(len(numbers) + 1))


def test_an_entry_has_the_numbers_that_an_item_will_have(tmp_path: Path) -> None:
    """As float32 fields hold them; the id of a jump is none of these."""
    path = tmp_path / "a.plan"
    text = jumping([2**24 + 1, 2**24], 2**24 + 1)
    path.write_text(text.replace("2, 0, 0, 0, 0, 0]", "0.123456789, null, 0, 0, 0, 1.23456789]"))
    jump = {"command": 177, "frame": 3, "params": [1.0, 0.12345679, None, 0.0]}
    held = read_mission_file(path)
    assert held.entries[-1] == jump | {"x": 0, "y": 0, "z": 1.2345679}
    assert math.isnan(held.items[-1].param3)


def test_public_kinds_of_files_are_read() -> None:
    def held(name: str) -> MissionFile:
        return read_mission_file(OTHERS / name)

    plans = [held(f"jump_ids{name}.plan").items for name in ("", "_as_meant")]
    assert repr(contents(plans[0])) == repr(contents(plans[1]))
    assert [item.command for item in held("numbers_not_in_order.waypoints").items] == [
        16,
        18,
        18,
        16,
    ]
    assert len(held("indented_comment.waypoints").items) == 3
    assert is_mission_file(OTHERS / "speeds.txt")
    speeds = [item.param2 for item in held("speeds.txt").items if item.command == 178]
    assert speeds == [16.0, 20.0, 15.0]


def test_a_survey_is_the_items_that_it_carries() -> None:
    """Jumps lead into it by their ids, and what it has no number for counts behind it."""
    items = read_mission_file(OTHERS / "survey.plan").items
    assert [item.command for item in items] == [16, 22, *[16, 206] * 6, 530, 177, 20]
    assert items[2].z == 100.0
    assert [item.param1 for item in items if item.command == 206] == [25.0, 0.0] * 3
    assert items[-2].param1 == 12.0


def test_a_landing_pattern_is_what_qgroundcontrol_makes_of_it() -> None:
    items = read_mission_file(OTHERS / "landing_pattern.plan").items
    assert [item.command for item in items[2:]] == [189, 206, 2001, 2501, 31, 21]
    circle, land = items[-2:]
    assert (circle.param1, circle.param2, circle.param4, circle.z) == (1.0, -120.0, 1.0, 40.0)
    assert (circle.x, circle.frame, land.z) == (474030899, 3, 0.0)
    plain = json.loads((OTHERS / "landing_pattern.plan").read_text())["mission"]["items"][1]
    plain |= {"useLoiterToAlt": False, "stopTakingPhotos": False, "stopVideoPhotos": False}
    found = [item["command"] for _, item in simple_items([plain], "items")]
    assert found == [189, 16, 21]


def test_the_format_before_plans_is_read() -> None:
    held = read_mission_file(OTHERS / "old_format.mission")
    assert is_mission_file(OTHERS / "old_format.mission")
    assert contents(held.items)[1:] == [
        (1, 18, 3, 1.0, 0.0, 0.0, 0.0, 473977000, 85456000, 100.0),
        (2, 16, 3, 0.0, 5.0, 0.0, 0.0, 474057848, 85456000, 100.0),
    ]
    assert held.items[0].z == 488.0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"geoFence": {"polygon": [[1, 2]], "version": 1}, "rallyPoints": {"a\x1b": 1}},
            ["geoFence.polygon", "rallyPoints.a\\x1b"],
        ),
        ({"geoFence": {"polygon": [], "version": 1}}, []),
        ({"version": 2}, ["what is new in version 2"]),
        ({"survey\x1b": {}}, ["survey\\x1b"]),
        ({"geoFence": None, "rallyPoints": 7}, []),
        ({"mission": {"cruiseSpeed": 18}}, ["a cruise speed of 18 m/s"]),
        ({"mission": {"hoverSpeed": 5}}, ["a hover speed of 5 m/s"]),
        ({"mission": {"vehicleType": 2}}, ["vehicleType 2, which is no fixed-wing aircraft"]),
        ({"mission": {"version": 3}}, ["what is new in mission.version 3"]),
        ({"mission": {"gimbal": 1}}, ["mission.gimbal"]),
        (
            {"mission": {"items": [PLAN["mission"]["items"][0] | {"autoContinue": False}]}},
            ["autoContinue false of 1 item"],
        ),
    ],
)
def test_what_is_not_flown_of_a_plan_is_told(
    changes: dict[str, Any], told: list[str], tmp_path: Path
) -> None:
    speeds = {"cruiseSpeed", "hoverSpeed"}
    mission = {k: v for k, v in PLAN["mission"].items() if k not in speeds}
    whole = {**PLAN, **changes, "mission": mission | changes.get("mission", {})}
    path = tmp_path / "a.plan"
    path.write_text(json.dumps(whole))
    assert list(read_mission_file(path).not_flown) == told


@pytest.mark.parametrize("extra", [MAX_NOT_FLOWN, MAX_NOT_FLOWN + 1, 3000])
def test_of_very_many_keys_that_are_not_flown_the_first_are_named(
    extra: int, tmp_path: Path
) -> None:
    mission = {k: v for k, v in PLAN["mission"].items() if not k.endswith("Speed")}
    path = tmp_path / "a.plan"
    path.write_text(json.dumps(PLAN | {"mission": mission} | {f"k{i}": 0 for i in range(extra)}))
    named = [f"k{i}" for i in range(extra)]
    if extra > MAX_NOT_FLOWN:
        first = MAX_NOT_FLOWN - 1
        named = [*named[:first], f"{extra - first} more keys"]
    assert list(read_mission_file(path).not_flown) == named

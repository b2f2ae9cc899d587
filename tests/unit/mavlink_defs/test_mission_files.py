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

from mavlink_defs.config.models import ConfigError
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.mission_files import (
    is_mission_file,
    mission_item,
    plan_text,
    read_mission_file,
    waypoints_text,
)
from mavlink_defs.services.mission import MissionItem

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
missions = st.lists(items, min_size=1, max_size=5)


def numbered(listed: list[MissionItem]) -> tuple[MissionItem, ...]:
    for seq, item in enumerate(listed):
        item.seq = seq
    return tuple(listed)


def contents(listed: Any) -> list[tuple[float, ...]]:
    return [
        (i.seq, i.command, i.frame, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z)
        for i in listed
    ]


def read(text: str, folder: Path, name: str = "mission.waypoints") -> tuple[MissionItem, ...]:
    path = folder / name
    path.write_text(text)
    return read_mission_file(path)


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
    again = read_mission_file(tmp_path / "theirs.waypoints")
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
        (f"QGC WPL 110\n{LINE}{LINE}", "item 1: expected the number 1, got 0"),
        (f"QGC WPL 110\n{LINE.replace('149.1', '1e9')}", "item 0: expected degrees, got -35.3"),
        (f"QGC WPL 110\n{LINE.replace('16', '70000')}", "item 0: there is no command 70000"),
        ("{", "is no JSON: "),
        ("{}", "expected a plan with fileType 'Plan' and a mission"),
        (plan(items=None), "mission.items: expected a list"),
        (plan(items=[{"type": "ComplexItem", "complexItemType": "survey"}]), "got survey"),
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
def test_files_are_known_by_name(name: str, expected: bool) -> None:
    assert is_mission_file(Path(name)) is expected

"""Fence and rally points in QGroundControl's plans: read as it uploads them, written back."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from mavlink_defs.config.models import ConfigError
from mavlink_defs.mission_files import items_of, plan_text, read_mission_file

OTHERS = Path(__file__).parents[2] / "data" / "others"
PLAN = json.loads((OTHERS / "fence_and_rally.plan").read_text())


def test_our_own_plans_hold_fence_and_rally_points_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "ours.plan"
    held = read_mission_file(OTHERS / "fence_and_rally.plan")
    path.write_text(plan_text(held.items, items_of(held.fence), items_of(held.rally)))
    ours = read_mission_file(path)
    assert (ours.not_flown, ours.fence, ours.rally) == ((), held.fence, held.rally)


FENCE: dict[str, Any] = {
    "circles": [
        {"circle": {"center": [-35.1, 149.2], "radius": 300.5}, "inclusion": True, "version": 1},
        {"circle": {"center": [-35.2, 149.3], "radius": 20}, "inclusion": False, "version": 1},
    ],
    "polygons": [
        {"polygon": [[-35.0, 149.0], [-35.4, 149.0], [-35.4, 149.5]], "inclusion": True},
        {"polygon": [[-35.1, 149.1], [-35.2, 149.1], [-35.2, 149.2], [-35.1, 149.2]]}
        | {"inclusion": False},
    ],
    "breachReturn": [-35.3, 149.1, 80],
    "version": 2,
}
RALLY = {"points": [[-35.3, 149.2, 100], [-35.31, 149.21, 90.5]], "version": 2}


def test_a_fence_of_a_plan_is_what_qgroundcontrol_uploads(tmp_path: Path) -> None:
    path = tmp_path / "a.plan"
    path.write_text(json.dumps({**PLAN, "geoFence": FENCE, "rallyPoints": RALLY}))
    held = read_mission_file(path)
    fence, rally = items_of(held.fence), items_of(held.rally)
    rows = [(i.seq, i.command, i.frame, i.param1, i.x, i.y, i.z) for i in (*fence, *rally)]
    assert rows == [
        (0, 5001, 0, 3.0, -350000000, 1490000000, 0.0),
        (1, 5001, 0, 3.0, -354000000, 1490000000, 0.0),
        (2, 5001, 0, 3.0, -354000000, 1495000000, 0.0),
        (3, 5002, 0, 4.0, -351000000, 1491000000, 0.0),
        (4, 5002, 0, 4.0, -352000000, 1491000000, 0.0),
        (5, 5002, 0, 4.0, -352000000, 1492000000, 0.0),
        (6, 5002, 0, 4.0, -351000000, 1492000000, 0.0),
        (7, 5003, 0, 300.5, -351000000, 1492000000, 0.0),
        (8, 5004, 0, 20.0, -352000000, 1493000000, 0.0),
        (9, 5000, 3, 0.0, -353000000, 1491000000, 80.0),
        (0, 5100, 3, 0.0, -353000000, 1492000000, 100.0),
        (1, 5100, 3, 0.0, -353100000, 1492100000, 90.5),
    ]
    path.write_text(plan_text(held.items, fence, rally))
    written = json.loads(path.read_text())
    polygons = [shape | {"version": 1} for shape in FENCE["polygons"]]
    assert written["geoFence"] == {**FENCE, "polygons": polygons}
    assert written["rallyPoints"] == RALLY


@pytest.mark.parametrize(
    ("section", "tree", "text"),
    [
        ("geoFence", {"circles": [{}]}, r"geoFence.circles[0].inclusion: expected true or false"),
        ("geoFence", {"circles": [7]}, r"geoFence.circles[0]: expected an object, got 7"),
        (
            "geoFence",
            {"circles": [{"inclusion": True}]},
            r"geoFence.circles[0].circle: expected centre and radius",
        ),
        (
            "geoFence",
            {"circles": [{"inclusion": True, "circle": {"center": [1, 2], "radius": "x"}}]},
            r"geoFence.circles[0].circle: expected numbers, got 'x'",
        ),
        (
            "geoFence",
            {"polygons": [{"inclusion": True, "polygon": [[1, 2], [3]]}]},
            r"geoFence.polygons[0].polygon[1]: expected 2 numbers, got [3]",
        ),
        (
            "geoFence",
            {"polygons": [{"inclusion": 1, "polygon": []}]},
            r"geoFence.polygons[0].inclusion: expected true or false, got 1",
        ),
        (
            "geoFence",
            {"polygons": [{"inclusion": True, "polygon": []}]},
            r"geoFence.polygons[0].polygon: expected corners, got none",
        ),
        ("geoFence", {"breachReturn": [1, 2]}, r"geoFence.breachReturn: expected 3 numbers"),
        ("rallyPoints", {"points": [[1, 2, 3], 4]}, r"rallyPoints.points[1]: expected 3 numbers"),
    ],
)
def test_shapes_that_are_none_are_refused(
    section: str, tree: Any, text: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.plan"
    path.write_text(json.dumps({**PLAN, section: tree}))
    with pytest.raises(ConfigError, match=re.escape(text)):
        read_mission_file(path)

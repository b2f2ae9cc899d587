"""Geometry of fences against slow rules of another kind, and items that describe none."""

import functools
import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.fence import (
    Fence,
    FenceArea,
    FenceWatch,
    crossing_edges,
    decode_fence,
    decode_rally,
)
from ftc_autopilot.guidance.fence_parameters import (
    ALT_MAX,
    ALT_MIN,
    AROUND_HOME,
    FenceParameters,
    RallyParameters,
    fence_records,
)
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import PathPoint, point_at
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
IN, OUT = (
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLE_IN, CIRCLE_OUT = (
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
RETURN, RALLY = dialect.MAV_CMD_NAV_FENCE_RETURN_POINT, dialect.MAV_CMD_NAV_RALLY_POINT
SQUARE = ((-900.0, -900.0), (-900.0, 900.0), (900.0, 900.0), (900.0, -900.0))

Corners = Sequence[tuple[float, float]]


def item(
    command: int, north: float, east: float, param: float = 0.0, frame: int = 0
) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)[:2]
    return mission_item(0, command, (param,), *place, 0.0, frame)


def polygon(corners: Corners, command: int = IN, count: float | None = None) -> list[MissionItem]:
    number = float(len(corners)) if count is None else count
    return [item(command, *corner, number) for corner in corners]


def numbered(items: Sequence[MissionItem]) -> list[MissionItem]:
    for seq, one in enumerate(items):
        one.seq = seq
    return list(items)


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """Draw a polygon around a centre, which any ray from there crosses once."""
    count = draw(st.integers(3, 12))
    gaps = [draw(st.floats(0.3, 1.0)) for _ in range(count)]
    angles = np.cumsum(gaps) * 2.0 * np.pi / sum(gaps)
    radii = np.array([draw(st.floats(10.0, 500.0)) for _ in range(count)])
    centre = np.array([draw(st.floats(-300.0, 300.0)) for _ in range(2)])
    turned: np.ndarray = centre + np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None]
    return turned if draw(st.booleans()) else turned[::-1]


def winding(corners: np.ndarray, place: tuple[float, float]) -> float:
    """The angle under which a polygon turns around a place; ± 2 pi inside, 0 outside."""
    to = corners - np.array(place)
    bearings = np.arctan2(to[:, 1], to[:, 0])
    turns = np.diff(np.append(bearings, bearings[0]))
    return float(np.sum((turns + np.pi) % (2.0 * np.pi) - np.pi))


@given(stars(), st.floats(-900.0, 900.0), st.floats(-900.0, 900.0), st.booleans())
def test_clearance_is_the_distance_to_the_edge(
    corners: np.ndarray, north: float, east: float, stay_in: bool
) -> None:
    share = np.linspace(0.0, 1.0, 4001)[:, None, None]
    edges = corners + share * (np.roll(corners, -1, axis=0) - corners)
    distances = np.hypot(edges[..., 0] - north, edges[..., 1] - east)
    assume(distances.min() > 1e-3)
    inside = abs(winding(corners, (north, east))) > math.pi
    expected = distances.min() if inside == stay_in else -distances.min()
    other = FenceArea(9, True, np.array([(0.0, 0.0)]), 1e5)  # far away
    (found, _) = Fence((other, FenceArea(0, stay_in, corners), other)).nearest((north, east))
    assert math.copysign(1.0, found) == math.copysign(1.0, expected)
    assert found == pytest.approx(expected, abs=0.4)  # of two samples, half apart


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(1.0, 60.0), st.booleans())
def test_clearance_of_a_circle(north: float, east: float, radius: float, stay_in: bool) -> None:
    area = FenceArea(0, stay_in, np.array([(3.0, -4.0)]), radius)
    inside = radius - math.dist((north, east), (3.0, -4.0))
    assert Fence((area,)).nearest((north, east))[0] == pytest.approx(inside if stay_in else -inside)


def share_a_point(a: Corners, b: Corners) -> bool:
    """Whether two closed segments have a point in common, exactly."""
    (p, q), (r, s) = ([tuple(map(Fraction, map(int, end))) for end in one] for one in (a, b))
    d, e, f = [(v[0] - u[0], v[1] - u[1]) for u, v in ((p, q), (r, s), (p, r))]
    det = d[0] * e[1] - d[1] * e[0]
    if det:
        t, u = (f[0] * e[1] - f[1] * e[0]) / det, (f[0] * d[1] - f[1] * d[0]) / det
        return 0 <= t <= 1 and 0 <= u <= 1
    if f[0] * d[1] != f[1] * d[0]:
        return False
    along = [(at[0] * d[0] + at[1] * d[1]) for at in (p, q, r, s)]
    return max(min(along[:2]), min(along[2:])) <= min(max(along[:2]), max(along[2:]))


@given(
    st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=8, unique=True)
)
def test_edges_that_meet_are_found(corners: Corners) -> None:
    count = len(corners)
    edges = [(corners[k], corners[(k + 1) % count]) for k in range(count)]
    meeting = [
        (i, k)
        for i, k in combinations(range(count), 2)
        if k - i not in {1, count - 1} and share_a_point(edges[i], edges[k])
    ]
    found = crossing_edges(np.array(corners, float))
    assert found in meeting if meeting else found is None


@given(stars())
def test_a_star_is_taken(corners: np.ndarray) -> None:
    assert crossing_edges(corners) is None


INVALID = dialect.MAV_MISSION_INVALID
PARAM1 = dialect.MAV_MISSION_INVALID_PARAM1
BOW = (SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3])
REFUSED = [
    (polygon(SQUARE[:2]), 0, PARAM1, "polygon of 2 corners, must be a whole number, at least 3"),
    (polygon(SQUARE, count=3.5), 0, PARAM1, "polygon of 3.5 corners, must be a whole number"),
    (polygon(SQUARE, count=math.inf), 0, PARAM1, "polygon of inf corners"),
    (polygon(SQUARE, count=math.nan), 0, PARAM1, "polygon of 0 corners"),
    ([item(CIRCLE_IN, 0.0, 0.0, math.inf)], 0, PARAM1, "radius inf m"),
    (polygon(SQUARE, count=5.0), 3, PARAM1, "polygon of 5 corners ends after 4 corners"),
    (polygon(SQUARE[:3], count=4.0) + polygon(SQUARE, OUT), 3, PARAM1, "ends after 3 corners"),
    (polygon(SQUARE[:2], count=4.0) + polygon(SQUARE[2:], count=3.0), 2, PARAM1, "after 2 corners"),
    (polygon(BOW), 2, INVALID, "polygon's edges from items 0 and 2 cross or touch"),
    (polygon([(0.0, 0.0), (9.0, 9.0), (18.0, 18.0)], OUT), 0, INVALID, "encloses no area"),
    (polygon([SQUARE[0]] * 4), 0, INVALID, "encloses no area"),
    ([item(CIRCLE_IN, 0.0, 0.0, 0.0)], 0, PARAM1, "radius 0 m, must be above 0 and at most 100000"),
    ([item(CIRCLE_OUT, 0.0, 0.0, math.nan)], 0, PARAM1, "radius nan m"),
    ([item(CIRCLE_OUT, 50.0, 0.0, 80.0)], 0, INVALID, "home is 30 m within the exclusion circle"),
    ([item(CIRCLE_IN, 500.0, 0.0, 80.0)], 0, INVALID, "home is 420 m outside the inclusion circle"),
    (
        [*polygon(SQUARE, OUT), item(CIRCLE_IN, 0.0, 0.0, 50.0)],
        0,
        INVALID,
        "home is 900 m within the exclusion polygon of item 0",
    ),
    (
        [item(RETURN, 0.0, 2000.0), *polygon(SQUARE)],
        0,
        INVALID,
        "the return point is 1100 m outside the inclusion polygon of item 1",
    ),
    ([item(RETURN, 0.0, 0.0), item(RETURN, 9.0, 0.0)], 1, INVALID, "a second return point"),
    ([item(16, 0.0, 0.0)], 0, dialect.MAV_MISSION_UNSUPPORTED, "command 16 is none of a fence"),
    (
        [item(CIRCLE_IN, 0.0, 0.0, 80.0, frame=1)],
        0,
        dialect.MAV_MISSION_UNSUPPORTED_FRAME,
        "frame 1 is not supported",
    ),
    (
        [item(CIRCLE_OUT, 2e5, 0.0, 80.0)],
        0,
        dialect.MAV_MISSION_INVALID_PARAM5_X,
        "km from the origin",
    ),
]


@pytest.mark.parametrize(("items", "seq", "result", "text"), REFUSED)
def test_what_is_no_fence_is_refused_by_item_and_reason(
    items: list[MissionItem], seq: int, result: int, text: str
) -> None:
    with pytest.raises(ItemError, match=text) as caught:
        decode_fence(numbered(items), ORIGIN, Home())
    assert (caught.value.seq, caught.value.mav_mission_result) == (seq, result)


def test_a_fence_is_all_inclusions_and_no_exclusion() -> None:
    items = [
        *polygon(SQUARE, IN),
        *polygon([(300.0, -200.0), (300.0, 200.0), (600.0, 0.0)], OUT),
        item(CIRCLE_IN, 0.0, 0.0, 800.0, frame=3),
        item(CIRCLE_OUT, -400.0, 0.0, 100.0),
        item(RETURN, 100.0, 0.0, frame=3),
    ]
    fence = decode_fence(numbered(items), ORIGIN, Home())
    assert fence.return_point == pytest.approx((100.0, 0.0), abs=0.02)
    assert [area.item for area in fence.areas] == [0, 4, 7, 8]
    for place, clear in (
        ((0.0, 0.0), 300.0),
        ((-350.0, 0.0), -50.0),
        ((400.0, 0.0), -100.0),
        ((-850.0, 0.0), -50.0),
    ):
        assert fence.nearest(place)[0] == pytest.approx(clear, abs=1.0)
    assert Fence().nearest((0.0, 0.0)) == (math.inf, None)


def test_a_polygon_may_be_closed_by_its_first_corner() -> None:
    items = numbered(polygon([*SQUARE, SQUARE[0]]))
    (area,) = decode_fence(items, ORIGIN, Home()).areas
    assert Fence((area,)).nearest((0.0, 0.0))[0] == pytest.approx(900.0, abs=0.1)


def test_edges_on_one_line_with_a_gap_between_them_do_not_meet() -> None:
    ends = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)]
    assert crossing_edges(np.array(ends, float)) is None


def test_an_edge_shorter_than_a_metre_counts() -> None:
    corners = np.array([(0.0, 0.0), (100.0, 0.0), (100.0, 0.4), (0.0, 50.0)])
    fence = Fence((FenceArea(0, stay_in=True, corners=corners),))
    assert fence.nearest((100.01, 0.2))[0] == pytest.approx(-0.01)


def test_what_is_nearest_of_all_that_is_watched_counts() -> None:
    both = watch(type=ALT_MAX | AROUND_HOME, alt_max_m=50.0, radius_m=300.0)
    both = both._replace(home=Home(100.0, 0.0, 20.0))
    place = (200.0, 0.0, 60.0)
    assert (both.clearance(place), both.room(place)) == (10.0, 200.0)
    floor, ground = watch(type=ALT_MIN, alt_min_m=30.0), (0.0, 0.0, 0.0)
    assert floor.objection(ground, stands=True) is None
    assert floor.objection(ground, stands=False) == "outside the fence: below 30 m"


def test_home_outside_is_no_matter_for_a_fence_that_was_accepted_before() -> None:
    items = numbered(polygon(SQUARE))
    assert decode_fence(items, ORIGIN).areas
    with pytest.raises(ItemError, match="home is 100 m outside"):
        decode_fence(items, ORIGIN, Home(1000.0, 0.0, 0.0))


def test_rally_points(scenario1: Scenario) -> None:
    limits = scenario1.planner().limits
    place = place_of(ORIGIN, 300.0, -200.0, 0.0)[:2]
    good = [mission_item(0, RALLY, (), *place, 90.0), mission_item(1, RALLY, (), *place, 684.0, 0)]
    found = decode_rally(good, ORIGIN, Home(0.0, 0.0, 20.0), limits)
    assert [point.item for point in found] == [0, 1]
    assert found[0][:3] == pytest.approx((300.0, -200.0, 110.0), abs=0.02)
    assert found[1].height_m == pytest.approx(684.0 - ORIGIN.altitude_m)
    for bad, text in (
        (mission_item(0, 16, (), *place, 90.0), "Item 0: command 16 is no rally point"),
        (mission_item(0, RALLY, (), *place, -90.0), "Item 0: altitude is -90 m above home"),
    ):
        with pytest.raises(ItemError, match=text):
            decode_rally([bad], ORIGIN, Home(), limits)


@given(
    st.floats(-500.0, 2500.0),
    st.floats(-500.0, 2500.0),
    st.floats(50.0, 600.0),
)
def test_a_path_that_leaves_is_noticed(north: float, east: float, radius: float) -> None:
    area = FenceArea(0, stay_in=False, corners=np.array([(north, east)]), radius=radius)
    points = points_of_path()
    clear = np.array([math.dist((p.north, p.east), (north, east)) for p in points]) - radius
    found = watch(Fence((area,))).left_by(path())
    if clear.min() < -10.0:
        assert found is not None
        assert found <= path()["item"][points[int(np.argmax(clear < -10.0))].leg]
    if found is not None and clear.min() > 5.0:  # on the circle at the end
        assert found == int(path()["item"][path()["count"] - 1])


@functools.cache
def points_of_path() -> list[PathPoint]:
    """Points of the way to the last circle."""
    end = float(path()["start"][path()["count"] - 1])
    return [point_at(path(), s) for s in np.linspace(0.0, end, 3000)]


@functools.cache
def path() -> np.void:
    from gcs.scenario.bundled import find_scenario
    from gcs.scenario.model import read_scenario

    corners = ((2000.0, 0.0), (2000.0, 2000.0), (0.0, 2000.0))
    items = [mission_item(0, 16)]
    for seq, corner in enumerate(corners, start=1):
        items.append(mission_item(seq, 16, (), *place_of(ORIGIN, *corner, 0.0)[:2], 100.0))
    return read_scenario(find_scenario("paper/scenario1")).planner().path(items)


def test_a_small_area_on_the_way_is_noticed() -> None:
    area = FenceArea(0, stay_in=False, corners=np.array([(1000.0, 0.0)]), radius=12.0)
    assert watch(Fence((area,))).left_by(path()) == 1


def test_a_path_that_climbs_too_high_is_noticed() -> None:
    assert watch(type=ALT_MAX, alt_max_m=120.0).left_by(path()) is None
    assert watch(type=ALT_MAX, alt_max_m=99.0).left_by(path()) == 1


def test_a_path_may_be_below_the_least_height_on_a_runway_alone() -> None:
    floor, record = watch(type=ALT_MIN, alt_min_m=150.0), path().copy()
    assert floor.left_by(record) == 1
    record["take_off"] = record["start"][record["count"] - 1]
    assert floor.left_by(record) == record["item"][record["count"] - 1]
    record["take_off"], record["final"] = 0.0, 1e-9
    assert floor.left_by(record) == 1
    record["final"] = -1.0  # all is landing
    assert floor.left_by(record) is None


def watch(fence: Fence = Fence(), **parameters: Any) -> FenceWatch:  # noqa: B008 - frozen
    record = fence_records(FenceParameters(**parameters), RallyParameters()).fence[0]
    return FenceWatch(fence, record)

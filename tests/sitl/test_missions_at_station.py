"""Missions from the ground: the commands and the dashboard against a fleet that flies one."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from flying import hexagon_tree, run
from operating import Operator, drive, make_fly, operator
from station import BAD_INPUT, REFUSED, Up, failed, up
from textual.widgets import Input
from waiting import until_focused

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.mission_places import home_item
from gcs.scenario.moved_mission import moved_to
from gcs.station.mission import is_same
from gcs.tui.fleet_table import FleetTable
from gcs.tui.mission_list import MissionList
from gcs.tui.missions import MapView, MissionsPanel
from mavlink_defs import dialect
from mavlink_defs.mission_files import (
    mission_item,
    plan_text,
    read_mission_file,
    waypoints_text,
)

pytestmark = pytest.mark.sitl

CIRCLE = dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
HOME = place_of(Origin(), 0.0, 0.0, 0.0)[:2]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """Three UAVs in formation, waiting to be armed; in lockstep they fly well on any machine."""
    with up(tmp_path_factory.mktemp("fleet"), "--lockstep", tree=hexagon_tree()) as fleet:
        yield fleet


def test_a_mission_is_downloaded_and_uploaded_again(fleet: Up, tmp_path: Path) -> None:
    plan, table = tmp_path / "held.plan", tmp_path / "held.waypoints"
    for path in (plan, table):
        done = fleet.gcs("mission", "download", "--out", path)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.splitlines()[0] == "UAV 1 holds 7 items"
    assert is_same(read_mission_file(plan).items, read_mission_file(table).items)
    download = fleet.gcs("mission", "download", "--uav", "2")
    assert download.stdout.splitlines()[-1].split() == ["7", "jump", "to", "1,", "always"]
    answer = fleet.gcs_json("mission", "upload", table)
    accepted = {"outcome": "accepted", "items": 7, "not_flown": []}
    assert answer == [{"uav": i} | accepted for i in (1, 2, 3)]
    again = tmp_path / "again.plan"
    assert fleet.gcs("mission", "download", "--out", again).returncode == 0
    assert again.read_text() == plan.read_text()


def test_a_mission_of_elsewhere_is_flown_around_the_home_of_each_vehicle(
    fleet: Up, tmp_path: Path
) -> None:
    held, far, again = (tmp_path / f"{name}.waypoints" for name in ("held", "far", "again"))
    assert fleet.gcs("mission", "download", "--out", held).returncode == 0
    elsewhere = home_item(Origin(latitude_deg=47.4, longitude_deg=8.5))
    far.write_text(waypoints_text(moved_to(elsewhere, read_mission_file(held).items)))
    refused = fleet.gcs("mission", "upload", far)
    assert refused.returncode == REFUSED
    assert "to fly it here, gcs mission has --here" in refused.stderr
    uploaded = fleet.gcs_json("mission", "upload", far, "--here")
    assert [answer["outcome"] for answer in uploaded] == ["accepted"] * 3
    assert fleet.gcs("mission", "download", "--out", again).returncode == 0
    pairs = zip(read_mission_file(held).items, read_mission_file(again).items, strict=True)
    assert max(abs(a.x - b.x) + abs(a.y - b.y) for a, b in pairs) < 10  # 0.1 m


def test_fence_and_rally_points_of_a_plan_go_and_come_back(fleet: Up, tmp_path: Path) -> None:
    path, again = tmp_path / "fenced.plan", tmp_path / "again.plan"
    assert fleet.gcs("mission", "download", "--out", path).returncode == 0
    circle = mission_item(0, CIRCLE, (9000.0,), *HOME, 0.0, 0)
    rally = mission_item(0, dialect.MAV_CMD_NAV_RALLY_POINT, (), *HOME, 90.0)
    path.write_text(plan_text(read_mission_file(path).items, [circle], [rally]))
    answer = fleet.gcs_json("mission", "upload", path)
    accepted = {"outcome": "accepted", "items": 7, "not_flown": [], "fence": 1, "rally": 1}
    assert answer == [{"uav": i} | accepted for i in (1, 2, 3)]
    done = fleet.gcs("mission", "download", "--uav", "2")
    assert done.stdout.splitlines()[0] == "UAV 2 holds 7 items, a fence of 1 item, 1 rally point"
    assert "  fence   0 inclusion circle, radius 9000 m" in done.stdout.splitlines()
    assert fleet.gcs("mission", "download", "--out", again).returncode == 0
    assert again.read_text() == path.read_text()


def test_what_show_refuses_the_vehicles_refuse_for_the_same_reason(
    fleet: Up, tmp_path: Path
) -> None:
    path = tmp_path / "lands.waypoints"
    done = fleet.gcs("mission", "download", "--uav", "1", "--out", path)
    items = [*read_mission_file(path).items[:-1], mission_item(7, dialect.MAV_CMD_NAV_LAND)]
    path.write_text(waypoints_text(items))
    reason = "Item 7: the aircraft has no gear to land on; add `gear: {kind: tricycle}` to it, or"
    reason += " `{kind: belly}`"
    done = run("gcs", "mission", "show", path)
    assert (done.returncode, done.stderr) == (BAD_INPUT, f"{path}: {reason}\n")
    done = fleet.gcs("mission", "upload", path, "--uav", "1")
    assert done.returncode == REFUSED
    assert reason in done.stderr
    assert fleet.gcs("mission", "download", "--uav", "1").stdout.startswith("UAV 1 holds 7 items")
    bad_name = fleet.gcs("mission", "download", "--out", tmp_path / "held.txt")
    assert ".plan nor .waypoints" in failed(bad_name, BAD_INPUT)


async def upload(someone: Operator, uploaded: str) -> None:
    """Upload a mission: again, if a busy machine held the dashboard up, or the vehicle."""
    failures = ("refused the upload", "did not answer the upload")

    def is_over(in_vain: int) -> bool:
        return uploaded in someone.log or sum(map(someone.log.count, failures)) > in_vain

    for in_vain in range(3):
        await someone.press("u")
        await someone.answer("enter")
        await someone.sees(partial(is_over, in_vain), uploaded)
        if uploaded in someone.log:
            break
    await someone.sees_event("1 action", uploaded)


def test_the_dashboard_shows_the_flight_and_changes_the_mission(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet) as someone:
            await make_fly(someone)
            await someone.sees(lambda: "AUTO" in someone.row(1), "AUTO")
            table = someone.app.query_one("#fleet-table", FleetTable)
            await someone.press("c")  # at this width another group of columns follows
            await someone.sees(lambda: "sep m" in str(table.columns), "separation")
            await someone.press("7")
            await until_focused(someone.pilot, "mission-list")
            items = someone.app.query_one(MissionList)
            await someone.sees(lambda: len(items.rows) == 7, "the items")
            await someone.sees(lambda: " of 7, " in str(items.border_title), "progress")
            drawn = someone.app.query_one(MapView)
            await someone.sees(lambda: "no wind" in str(drawn.border_title), "the wind")
            await someone.press("end", "up", "e")
            await until_focused(someone.pilot, "item-place")
            field = someone.app.query_one("#item-place", Input)
            assert field.value == "0 0 100"
            field.value = "0 0 140"
            await someone.press("enter")
            await upload(someone, "mission of 7 items uploaded")
            await someone.sees(lambda: "N 0 E 0 140" in items.text, "the height")
            await someone.sees(
                lambda: someone.app.query_one(MissionsPanel).draft is None, "it is the vehicle's"
            )
            assert not is_same(someone.state(1).mission or (), someone.state(2).mission or ())

    drive(work())


def test_a_mission_is_flown_at_once(fleet: Up, tmp_path: Path) -> None:
    path = tmp_path / "held.plan"
    assert fleet.gcs("mission", "download", "--uav", "2", "--out", path).returncode == 0
    done = fleet.gcs("mission", "fly", path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [f"UAV {i} flies 7 items of {path}" for i in (1, 2, 3)]

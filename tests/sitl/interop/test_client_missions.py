"""MAVSDK and MAVProxy fly missions in space, and send the aircraft to places and home."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from flying import scenario_tree, standing
from mavproxy import MavProxy
from mavsdk import Autopilot, ComponentType, Configuration, Mavsdk, System
from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Circle, FenceType, Geofence, GeofenceData, Point, Polygon
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.telemetry import FlightMode, Telemetry
from pymavlink import mavwp
from standing import Standing

from ftc_autopilot.common.geography import Origin, place_of
from gcs.scenario.model import scenario_of
from mavlink_defs.mission_files import mission_item, waypoints_text

pytestmark = pytest.mark.sitl

TIMEOUT_S = 600.0
ORIGIN = Origin()
HOME = place_of(ORIGIN, 0.0, 0.0, 0.0)[:2]


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Standing]:
    """One aircraft that waits; it flies in lockstep, as fast as the machine allows."""
    tree: dict[str, Any] = scenario_tree(duration_s=86_400.0, faults=[])
    tree["controller"] = {"kind": "surviving"}
    tree["uavs"] = tree["uavs"][:1]
    tree["network"] = {"leader_access": {1: 1.0}, "edges": []}
    scenario = scenario_of(tmp_path / "scenario.yaml", tree)
    with standing(scenario, tmp_path, speed=None) as started:
        yield Standing(started, tmp_path)


def wait(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.02)


@pytest.fixture
def system(fleet: Standing) -> Iterator[System]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(f"udpin://127.0.0.1:{fleet.port}")
    try:
        wait(lambda: mavsdk.system_count() == 1, "the vehicle")
        (found,) = mavsdk.get_systems()
        wait(lambda: found.autopilot_type() == Autopilot.ARDUPILOT, "its type")
        yield found
    finally:
        mavsdk.destroy()


def degrees(north: float, east: float) -> tuple[float, float]:
    latitude, longitude, *_ = place_of(ORIGIN, north, east, 0.0)
    return latitude / 1e7, longitude / 1e7


def waypoint(north: float, east: float) -> MissionItem:
    nothing = float("nan")
    return MissionItem(
        *degrees(north, east),
        relative_altitude_m=120.0,
        speed_m_s=45.0,
        is_fly_through=True,
        gimbal_pitch_deg=nothing,
        gimbal_yaw_deg=nothing,
        camera_action=MissionItem.CameraAction.NONE,
        loiter_time_s=nothing,
        camera_photo_interval_s=nothing,
        acceptance_radius_m=nothing,
        yaw_deg=nothing,
        camera_photo_distance_m=nothing,
        vehicle_action=MissionItem.VehicleAction.NONE,
    )


def test_mavsdk_flies_a_mission_and_returns(system: System) -> None:
    mission, action, telemetry = Mission(system), Action(system), Telemetry(system)
    mission.set_return_to_launch_after_mission(True)
    places = [waypoint(400.0, 0.0), waypoint(1200.0, 600.0)]
    mission.upload_mission(MissionPlan(places))
    action.arm()
    mission.start_mission()
    wait(lambda: telemetry.flight_mode() == FlightMode.MISSION, "flight mode MISSION")
    wait(lambda: mission.mission_progress().current >= 1, "the second waypoint")
    wait(mission.is_mission_finished, "the end of the mission")
    action.return_to_launch()
    wait(lambda: telemetry.flight_mode() == FlightMode.RETURN_TO_LAUNCH, "the way home")
    action.hold()
    wait(lambda: telemetry.flight_mode() == FlightMode.HOLD, "the circle")
    north, east = degrees(3000.0, -1000.0)
    action.goto_location(north, east, 704.0, 0.0)

    def is_there() -> bool:
        """At the place's height, on the circle around it."""
        at = telemetry.position()
        away: tuple[float, float]
        away = abs(at.latitude_deg - north) * 111_320.0, abs(at.longitude_deg - east) * 90_800.0
        return max(away) < 600.0 and 115.0 < at.relative_altitude_m < 125.0

    wait(is_there, "the place")


def test_mavsdk_transfers_raw_missions(system: System) -> None:
    raw = MissionRaw(system)
    place = place_of(ORIGIN, 2000.0, 0.0, 0.0)[:2]
    items = [
        RawItem(0, 0, 16, 1, 1, 0.0, 0.0, 0.0, 0.0, *place, 584.0, 0),
        RawItem(1, 6, 22, 0, 1, 15.0, 0.0, 0.0, 0.0, *place, 50.0, 0),  # takeoff, as plans begin
        RawItem(2, 6, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, *place, 120.0, 0),
        RawItem(3, 6, 18, 0, 1, 2.0, 0.0, 600.0, 0.0, *place, 120.0, 0),
        RawItem(4, 6, 20, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0, 0),
    ]
    raw.upload_mission(items)
    found = raw.download_mission()
    assert [(i.command, i.x, i.y, i.z) for i in found[1:]] == [
        (i.command, i.x, i.y, i.z) for i in items[1:]
    ]


def test_mavsdk_sets_and_reads_fence_and_rally_points(system: System) -> None:
    corners = ((-2000.0, -2000.0), (-2000.0, 2000.0), (2000.0, 2000.0), (2000.0, -2000.0))
    stay_in = Polygon([Point(*degrees(*corner)) for corner in corners], FenceType.INCLUSION)
    stay_out = Circle(Point(*degrees(1000.0, 0.0)), 80.0, FenceType.EXCLUSION)
    Geofence(system).upload_geofence(GeofenceData([stay_in], [stay_out]))
    raw = MissionRaw(system)
    fence = raw.download_geofence()
    assert [(item.command, item.param1) for item in fence] == [(5001, 4.0)] * 4 + [(5004, 80.0)]
    place = place_of(ORIGIN, 500.0, -300.0, 0.0)[:2]
    rally = [RawItem(0, 3, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, *place, 90.0, 2)]
    raw.upload_rally_points(rally)
    found = raw.download_rallypoints()
    assert [(item.command, item.x, item.y, item.z) for item in found] == [(5100, *place, 90.0)]
    raw.upload_geofence(fence)
    assert [item.seq for item in raw.download_geofence()] == [0, 1, 2, 3, 4]
    with pytest.raises(Exception, match=r"(?i)invalid|error|unsupported"):  # home is outside
        raw.upload_geofence([RawItem(0, 0, 5004, 0, 1, 80.0, 0, 0, 0, *HOME, 0.0, 1)])
    assert len(raw.download_geofence()) == 5
    Geofence(system).clear_geofence()
    assert raw.download_geofence() == []


def test_mavproxy_flies_waypoints_and_places(fleet: Standing, tmp_path: Path) -> None:
    items = [mission_item(0, 16, (), -353632620, 1491652370, 584.0, 0)]
    items.append(mission_item(1, 22, (15.0,), -353632620, 1491652370, 50.0))  # takeoff: skipped
    for seq, (north, east) in enumerate(((800.0, 0.0), (2000.0, 1500.0), (0.0, 1500.0)), start=2):
        items.append(mission_item(seq, 16, (), *place_of(ORIGIN, north, east, 0.0)[:2], 120.0))
    mine = tmp_path / "mine.waypoints"
    mine.write_text(waypoints_text(items))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(mine)) == 5
    with MavProxy(fleet.port, tmp_path) as mavproxy:
        mavproxy.wait_for(r"Detected vehicle 1:1 on link 0")
        mavproxy.wait_for(r"Received \d\d+ parameters")
        mavproxy.say(f"wp load {mine}", r"Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
        mavproxy.ask("wp list", r"16 3 -35\.34\d+ 149\.18\d+ 120\.0")
        mavproxy.say("wp loop", r"Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
        mavproxy.say("arm throttle", r"ARMED")
        mavproxy.say("long MISSION_START 0 0 0 0 0 0 0", r"MISSION_START: ACCEPTED")
        mavproxy.wait_for(r"waypoint 3")
        mavproxy.say("wp set 4", r"waypoint 4(?s:.*)\nwaypoint 2\n(?s:.*)waypoint 3")  # it loops
        latitude, longitude = degrees(3000.0, -3000.0)
        mavproxy.say(f"guided {latitude} {longitude} 150", r"AP: mode GUIDED")
        mavproxy.say("mode RTL", r"AP: mode RTL")
        mavproxy.say("mode LOITER", r"AP: mode LOITER")
        assert not re.search("Traceback|BAD_DATA", mavproxy.text)

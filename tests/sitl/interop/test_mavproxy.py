"""MAVProxy drives a fleet: everything that docs/how-to/clients.md says it can."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from mavproxy import MavProxy
from standing import Standing

pytestmark = pytest.mark.sitl

WAYPOINTS = """QGC WPL 110
0	1	0	16	0	0	0	0	-35.363262	149.165237	584	1
1	0	0	53100	0	40	0	0	0	0	0	1
2	0	0	53100	4	45	0	10	5	5	0	1
"""


@pytest.fixture(scope="module")
def mavproxy(fleet: Standing, tmp_path_factory: pytest.TempPathFactory) -> Iterator[MavProxy]:
    """One that has seen, when it is no longer used, no breach and no message that it lacks."""
    with MavProxy(fleet.port, tmp_path_factory.mktemp("mavproxy")) as running:
        for system in fleet.ids:
            running.wait_for(rf"Detected vehicle {system}:1 on link 0")
        running.wait_for(r"Received \d\d parameters")
        yield running
        running.ask("status", r"MAV Errors: 0")
        for word in ("fence breach", "Traceback", "BAD_DATA", "UNKNOWN_"):
            assert word not in running.text, word


def test_link_and_status(mavproxy: MavProxy) -> None:
    before, after = mavproxy.watch_link(packets=300)
    assert after == before
    mavproxy.ask("status", r"HEARTBEAT \{type : 1, autopilot : 3")
    mavproxy.say("long SET_MESSAGE_INTERVAL 53104 200000 0 0 0 0 0", r"INTERVAL: ACCEPTED")
    mavproxy.say("watch FTC_EVENTS", r"FTC_EVENTS \{time_boot_ms : 0")
    mavproxy.say(
        "watch SYSTEM_TIME", r"SYSTEM_TIME \{time_unix_usec : 1\d{15}, time_boot_ms : [1-9]"
    )
    mavproxy.say("watch SYS_STATUS", r"SYS_STATUS \{.*battery_remaining : (100|\d\d),")
    mavproxy.say("watch", "")


def test_the_vehicle_is_chosen(mavproxy: MavProxy) -> None:
    mavproxy.say("vehicle 2", r"Set vehicle 2 \(link 1\)")
    mavproxy.ask("param fetch SYSID_THISMAV", r"SYSID_THISMAV = 2")
    mavproxy.say("vehicle 1", r"Set vehicle 1 \(link 1\)")
    mavproxy.ask("param fetch SYSID_THISMAV", r"SYSID_THISMAV = 1")


def test_parameters(mavproxy: MavProxy) -> None:
    mavproxy.say("param fetch", r"Received \d\d parameters")
    mavproxy.ask("param show K1_*", r"K1_YAW +51\.0")
    mavproxy.say("param set K1_ROLL 42.5", r"AP: K1_ROLL is 42\.5 now")
    mavproxy.ask("param show K1_ROLL", r"K1_ROLL +42\.5")
    mavproxy.say("param set TRIG_MODE 1", r"AP: TRIG_MODE is 1 now")
    mavproxy.say("param set TRIG_MODE 0", r"AP: TRIG_MODE is 0 now")
    mavproxy.say("param set K1_ROLL -3", r"AP: K1_ROLL is -3, must be in \(0, 500\] 1/s")
    mavproxy.ask("param fetch K1_ROLL", r"K1_ROLL = 42\.5")


def test_missions(mavproxy: MavProxy, tmp_path: Path) -> None:
    loaded, saved = tmp_path / "in.txt", tmp_path / "out.txt"
    loaded.write_text(WAYPOINTS)
    mavproxy.say(f"wp load {loaded}", r"Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    mavproxy.ask("wp list", r"53100 0 5\.0\d* 5\.0\d* 0\.0\d* p1=4\.0 p2=45\.0 p3=0\.0 p4=10\.0")
    mavproxy.say(f"wp save {saved}", r"Saved 3 waypoints to .*out\.txt")
    rows = [[float(x) for x in line.split()] for line in WAYPOINTS.splitlines()[1:]]
    assert [[float(x) for x in line.split()] for line in saved.read_text().splitlines()[1:]] == rows
    mavproxy.say("wp set 2", r"waypoint 2")
    mavproxy.say("mode AUTO", r"AP: mode AUTO")
    mavproxy.say("wp clear", r"Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    mavproxy.ask("wp list", r"Requesting 0 waypoints")


FENCE = """QGC WPL 110
0	0	0	5001	3	0	0	0	-35.30	149.10	0	1
1	0	0	5001	3	0	0	0	-35.30	149.25	0	1
2	0	0	5001	3	0	0	0	-35.45	149.20	0	1
3	0	0	5004	50	0	0	0	-35.31	149.18	0	1
"""
RALLY = """QGC WPL 110
0	0	3	5100	0	0	0	0	-35.35	149.17	100	1
"""


def test_fence_and_rally_points(mavproxy: MavProxy, tmp_path: Path) -> None:
    for word, text, count, listed in (
        ("fence", FENCE, 4, r"5004 0 -35\.31\d+ 149\.1[78]\d+ 0\.0\d* p1=50\.0"),
        ("rally", RALLY, 1, r"5100 3 -35\.35\d+ 149\.1[67]\d+ 100\.0"),
    ):
        loaded, saved = tmp_path / f"{word}.txt", tmp_path / f"{word}.out"
        loaded.write_text(text)
        mavproxy.say(f"{word} load {loaded}", rf"Got MISSION_ACK: TYPE_{word.upper()}: ACCEPTED")
        mavproxy.ask(f"{word} list", listed)
        mavproxy.say(f"{word} save {saved}", rf"Saved {count} {word} items to .*{word}\.out")
        assert len(saved.read_text().splitlines()) == count + 1
    mavproxy.say("fence enable", r"fence enabled")
    mavproxy.say("fence disable", r"fence disabled")
    mavproxy.say("fence clear", r"Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
    mavproxy.say("rally clear", r"Got MISSION_ACK: TYPE_RALLY: ACCEPTED")
    mavproxy.ask("wp list", r"Requesting 0 waypoints")


def test_signing(mavproxy: MavProxy) -> None:
    mavproxy.say("vehicle 2", r"Set vehicle 2 \(link 1\)")
    mavproxy.say("signing setup correct-horse", r"AP: signing: key set")
    mavproxy.ask("param fetch SYSID_THISMAV", r"SYSID_THISMAV = 2")
    mavproxy.say("signing remove", r"AP: signing: off, anyone may command")
    mavproxy.ask("param fetch SYSID_THISMAV", r"SYSID_THISMAV = 2")
    mavproxy.say("vehicle 1", r"Set vehicle 1 \(link 1\)")


def test_modes_and_arming(mavproxy: MavProxy) -> None:
    mavproxy.say("mode GUIDED", r"Got COMMAND_ACK: DO_SET_MODE: ACCEPTED")
    mavproxy.say("mode LOITER", r"AP: mode LOITER")
    mavproxy.say("mode RTL", r"AP: mode RTL")
    mavproxy.say("mode TAKEOFF", r"Got COMMAND_ACK: DO_SET_MODE: DENIED")
    mavproxy.say("mode AUTOLAND", r"AP: Mode AUTOLAND: the aircraft has no gear")
    mavproxy.say("arm throttle", r"ARMED")
    mavproxy.say("disarm", r"DISARMED")


def test_private_commands(mavproxy: MavProxy) -> None:
    mavproxy.say("long FTC_SET_FAULT 2 0.5 0 0 nan nan 0", r"FTC_SET_FAULT: ACCEPTED")
    mavproxy.say("long FTC_SET_FAULT 2 7 0 0 nan nan 0", r"AP: Fault: Effectiveness is 7")
    mavproxy.say("long FTC_CLEAR_FAULTS -1 0 0 0 0 0 0", r"FTC_CLEAR_FAULTS: ACCEPTED")

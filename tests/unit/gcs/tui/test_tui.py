"""The data behind the dashboard, without a fleet and without a screen."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from plain_faults import actuator_fault, sensor_fault
from tui_bench import OWN, Station, live, playback

from gcs.commands.log import log
from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario
from gcs.scenario.profile_file import load_profile
from gcs.station.notifications import INFO, Notification
from gcs.station.vehicle_state import VehicleState
from gcs.tui.event_log import EventLog
from gcs.tui.fault_form import read_fault
from gcs.tui.fault_history import FaultHistory
from gcs.tui.formatting import count, number, percent, seconds, sparkline
from gcs.tui.playback import Playback
from gcs.tui.profile_views import differences, polyline
from gcs.tui.view import SILENT_S, FleetView
from mavlink_defs import dialect
from mavlink_defs.constants import Actuator
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_FAULTS
from mavlink_defs.services.machine import SystemId

SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"
RUDDER = actuator_fault(2, 0.5, 0.0, 0.0, 10.0, 20.0)


# texts


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (number(None), "–"),
        (number(math.nan), "–"),
        (number(-0.04), "0.0"),
        (number(-0.06), "-0.1"),
        (number(12.345, 2), "12.35"),
        (count(1234567), "1 234 567"),
        (percent(0.91666, 2), "91.67 %"),
        (percent(None), "–"),
        (seconds(None), "–"),
        (seconds(59.96), "60.0"),
        (seconds(754.0), "12:34"),
        (seconds(3725.0), "1:02:05"),
        (sparkline([0.0, 0.0, 1.0, 4.0, 8.0], 5), "  ▁▄█"),
        (sparkline([], 3), "   "),
        (sparkline([8.0, 0.0, 8.0], 2), " █"),
    ],
)
def test_texts(shown: str, expected: str) -> None:
    assert shown == expected


# the form


@pytest.mark.parametrize(
    ("actuator", "kind", "texts", "fault"),
    [
        (
            "rudder",
            "bias",
            {"effectiveness": "0.5"},
            actuator_fault(2, 0.5, 0.0, 0.0, math.nan, math.nan),
        ),
        (
            "aileron",
            "bias",
            {"value": "-2,5", "start_s": "3", "end_s": "4"},
            actuator_fault(0, 1.0, -2.5, 0.0, 3.0, 4.0),
        ),
        (
            "throttle",
            "stuck",
            {"value": "100", "effectiveness": "0.7", "frequency_hz": "2"},
            actuator_fault(3, 0.0, 100.0, 2.0, math.nan, math.nan),
        ),
    ],
)
def test_a_form_is_read(actuator: Actuator, kind: str, texts: dict[str, str], fault: Fault) -> None:
    read = read_fault(actuator, kind, texts)
    assert repr(read.fault) == repr(fault)  # NaN is not equal to itself
    assert read.problems == ()


@pytest.mark.parametrize(
    ("kind", "texts", "problem"),
    [
        ("bias", {}, "expected 'effectiveness'"),
        ("bias", {"effectiveness": "half"}, "effectiveness: expected a number, got 'half'"),
        ("bias", {"effectiveness": "-0.1"}, "effectiveness: expected [0, 1]"),
        ("bias", {"effectiveness": "nan"}, "effectiveness: expected a finite number"),
        ("bias", {"value": "1", "start_s": "5", "end_s": "5"}, "end_s: expected > start_s"),
        ("bias", {"value": "1", "frequency_hz": "501"}, "frequency_hz: expected [0, 500] Hz"),
        ("stuck", {}, "expected"),
    ],
)
def test_a_form_that_cannot_be_sent_says_why(
    kind: str, texts: dict[str, str], problem: str
) -> None:
    read = read_fault("rudder", kind, texts)
    assert read.fault is None
    assert problem in "\n".join(read.problems)


def test_a_form_of_a_sensor_is_read_and_has_the_values_that_it_says_by_itself() -> None:
    def read(sensor: str, kind: str, **texts: str) -> object:
        found = read_fault(sensor, kind, texts)
        return found.fault.describe() if found.fault else found.problems

    assert read("airspeed", "stuck", value="5") == "airspeed stuck from now, until cleared"
    assert read("airspeed", "fade") == "airspeed fades in 60 s from now, until cleared"
    bias = read("gyro", "bias", value="-2,5", instance="1", axis="y", start_s="3", end_s="4")
    assert bias == "gyro 1 y -2.5 deg/s in (3, 4] s"
    assert read("gyro", "bias", effectiveness="0.5") == "gyro +3 deg/s from now, until cleared"
    assert read("gyro", "drift") == ("drift °/s^2: expected a number, got nothing",)
    assert read("gyro", "off", instance="one") == ("instance: expected a whole number, got 'one'",)
    assert read("gyro", "bias", axis="w") == ("axis: expected 'x', 'y' or 'z', got 'w'",)
    assert "scale" not in SENSOR_FAULTS.kinds_of(SENSOR_FAULTS.named("gps"))


# event_log and fault_history


def test_the_event_log_keeps_the_latest() -> None:
    event_log = EventLog()
    for i in range(5010):
        event_log.receive(Notification(0.0, 1, "text", INFO, str(i)), 0.0, None)
    assert len(event_log.entries) == 5000
    assert [entry.text for entry in event_log.since(5007)] == ["5007", "5008", "5009"]
    assert len(event_log.since(0)) == 5000


def ack(command: int, asker: tuple[int, int] = OWN) -> Notification:
    message = dialect.MAVLink_command_ack_message(command, 0, 0, 0, *asker)
    return Notification(0.0, 3, "ack", INFO, "", message)


def test_the_fault_history_knows_who_acknowledged_what_and_when() -> None:
    fault_history, state = FaultHistory(OWN), VehicleState(SystemId(3, 1), 0.0)
    fault_history.receive(ack(dialect.MAV_CMD_FTC_SET_FAULT), 50.0)
    state.faults = (RUDDER,)
    fault_history.update(state, 51.0)
    fault_history.update(state, 52.0)
    (record,) = fault_history.records
    assert record.acknowledged is not None
    assert (record.acknowledged.at, record.acknowledged.asked_by) == (50.0, "this station")
    assert [record.phase(t) for t in (None, 10.0, 10.1, 20.0, 20.1)] == [
        "waiting",
        "waiting",
        "active",
        "active",
        "over",
    ]

    fault_history.receive(ack(dialect.MAV_CMD_FTC_SET_FAULT, (255, 190)), 60.0)
    state.faults = (RUDDER._replace(effectiveness=0.1),)
    fault_history.update(state, 61.0)
    assert record.phase(15.0) == "replaced"
    assert fault_history.last is not None
    assert fault_history.last.acknowledged is not None
    assert fault_history.last.acknowledged.asked_by == "station 255/190"

    fault_history.receive(ack(dialect.MAV_CMD_FTC_CLEAR_FAULTS), 70.0)
    state.faults = ()
    fault_history.update(state, 71.0)
    assert (fault_history.last.gone, fault_history.last.gone_at) == ("cleared", 71.0)
    assert fault_history.last.cleared is not None


def test_a_fault_is_in_the_history_as_soon_as_it_is_listed() -> None:
    station = Station(3)
    source = live(station)
    for notification in station.fleet.vehicles[3].learn_faults((RUDDER,), station.time_s):
        source.receive(notification)
    assert source.fault_history.last is not None


def test_one_command_for_all_gyros_is_one_acknowledgement() -> None:
    fault_history, state = FaultHistory(OWN), VehicleState(SystemId(3, 1), 0.0)
    fault_history.receive(ack(dialect.MAV_CMD_FTC_SET_SENSOR_FAULT), 50.0)
    gyros = tuple(sensor_fault(1, 1, 0.0, number, 12.0, math.inf) for number in (1, 2))
    state.faults = gyros
    fault_history.update(state, 51.0)
    assert [r.acknowledged and r.acknowledged.at for r in fault_history.records] == [50.0, 50.0]
    fault_history.receive(ack(dialect.MAV_CMD_INJECT_FAILURE), 60.0)
    state.faults = gyros[1:]
    fault_history.update(state, 61.0)
    first, second = fault_history.records
    assert (first.phase(61.0), second.phase(61.0)) == ("cleared", "active")
    assert first.cleared is not None
    assert first.cleared.at == 60.0


def test_a_restarted_vehicle_has_lost_its_faults() -> None:
    fault_history, state = FaultHistory(OWN), VehicleState(SystemId(3, 1), 0.0)
    state.faults = (RUDDER,)
    fault_history.update(state, 1.0)
    assert fault_history.records[0].acknowledged is None
    state.restarts, state.faults = 1, None
    fault_history.update(state, 2.0)
    assert fault_history.records[0].phase(15.0) == "restarted"


# the view


def test_a_view_says_whether_anything_is_new() -> None:
    station = Station(1, 2)
    view = FleetView(live(station))
    assert view.update()
    assert not view.update()
    assert view.selected == 1
    view.select_next(-1)
    assert view.selected == 2
    assert view.targets == (2,)
    view.marked = {1, 2}
    assert list(view.targets) == [1, 2]
    station.time_s += SILENT_S
    station.receive(1)
    assert view.update()
    silent = {state.system for state in view.states if view.is_silent(state)}
    assert silent == {2}


# profiles


def test_corners_and_differences_of_profiles(scenario1: Scenario) -> None:
    segments = scenario1.segments()
    assert polyline(segments, "yaw_deg") == (
        [0.0, 4.0, 4.0, 15.0, 15.0, 18.75],
        [0.0, 0.0, 10.0, 10.0, 10.0, 10.0],
    )
    ramp = (segments[0], replace(segments[1], ramp=True), segments[2])
    assert polyline(ramp, "yaw_deg")[1] == [0.0, 0.0, 0.0, 10.0, 10.0, 10.0]
    assert polyline((), "yaw_deg") == ([], [])
    assert differences(segments, segments) == 0
    assert differences(segments, ramp[:2]) == 2


# logs


def go(player: Playback, position_s: float) -> None:
    player.seek(position_s)
    while not player.advance():
        pass


def test_a_log_tells_faults_and_profile_that_were_sent() -> None:
    player = playback()
    player.playing = False
    go(player, 20.8)
    states = player.fleet.vehicles
    assert sorted(states) == [1, 2, 3]
    assert states[2].profile == load_profile(SCENARIO_1)
    assert states[3].active_faults == (actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0),)
    assert states[1].counts.total > 1000


def test_a_log_goes_back_and_tells_the_same_again() -> None:
    player = playback()
    player.playing = False
    go(player, 15.0)
    before = (player.fleet.vehicles[1].time_s, player.event_log.count, player.fleet.events)
    go(player, 23.9)
    go(player, 15.0)
    after = (player.fleet.vehicles[1].time_s, player.event_log.count, player.fleet.events)
    assert after == before


def test_a_log_plays_at_its_speed_to_its_end() -> None:
    now = 0.0
    player = playback(lambda: now)
    assert (player.begin_s, player.end_s) == (0.0, 24.0)
    player.change_speed(1)
    assert player.speed == 2.0
    assert player.advance()  # from now on time passes
    for _ in range(30):
        now += 0.1
        player.advance()
    assert player.position_s == pytest.approx(6.0)
    for _ in range(100):
        now += 1.0
        player.advance()
    assert (player.position_s, player.playing) == (player.end_s, False)


@pytest.mark.parametrize(
    ("content", "problem"),
    [(None, "cannot read"), (b"", "no MAVLink frame in it"), (b"x" * 50, "no MAVLink frame")],
)
def test_a_file_that_is_no_log_is_refused(
    content: bytes | None, problem: str, tmp_path: Path
) -> None:
    path = tmp_path / "file.tlog"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput, match=problem):
        log(path)


def test_a_log_cannot_be_asked() -> None:
    with pytest.raises(KeyError):
        playback().vehicle(1)

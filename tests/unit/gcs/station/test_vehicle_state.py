"""The state of a vehicle from its messages, with time passed in."""

import json
import math
from typing import Any

import pytest
from plain_faults import actuator_fault

from gcs.station.event_counts import EventCounts
from gcs.station.fleet_state import FleetState
from gcs.station.history import History
from gcs.station.notifications import ERROR, WARNING, Notification
from gcs.station.status import vehicle_status
from gcs.station.vehicle_state import LOST_S, VehicleState
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing.frames import FramePacker, parse, text_chunks
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import Segment, segments_to_items
from mavlink_defs.services.machine import SystemId

STANDBY, ACTIVE, BOOT = (
    dialect.MAV_STATE_STANDBY,
    dialect.MAV_STATE_ACTIVE,
    dialect.MAV_STATE_BOOT,
)
FAULT = actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0)
NONE = 0xFFFFFFFF
FENCE, RALLY = dialect.MAV_MISSION_TYPE_FENCE, dialect.MAV_MISSION_TYPE_RALLY


def heartbeat(status: int = STANDBY, armed: bool = False, mode: int = 12) -> MAVLink_message:
    flags = dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return dialect.MAVLink_heartbeat_message(1, 3, flags, mode, status, 3)


def events(time_s: float, steps: int, *counts: int, shortest: int = NONE) -> MAVLink_message:
    four = [*counts, 0, 0, 0, 0][:4]
    return dialect.MAVLink_ftc_events_message(
        round(time_s * 1000), steps, four, [shortest] * 4, sum(four), [0] * 4, 0
    )


def tracking(time_s: float, airspeed: float = 45.0) -> MAVLink_message:
    return dialect.MAVLink_ftc_tracking_message(
        round(time_s * 1000), [airspeed, 1.0, 2.0, 3.0], [0.5, 0.25, 0.0, -1.0], [0.0] * 4
    )


class Bench:
    """A fleet as the station knows it, and vehicles that say what the test wants."""

    def __init__(self, *first: int) -> None:
        self.fleet = FleetState()
        for system in first:
            self.say(heartbeat(), 0.0, system)

    def say(
        self, message: MAVLink_message, now: float, system: int = 1, component: int = 1
    ) -> list[Notification]:
        received = parse(FramePacker(system, component).pack(message))
        assert received is not None
        return self.fleet.receive(received, now)

    def state(self, system: int = 1) -> VehicleState:
        return self.fleet.vehicles[system]


def texts(notifications: list[Notification]) -> list[tuple[str, str]]:
    return [(one.kind, one.text) for one in notifications]


def test_vehicles_appear_by_their_heartbeats() -> None:
    bench = Bench()
    assert bench.say(tracking(1.0), 0.0, system=7) == []
    assert bench.fleet.vehicles == {}
    assert bench.fleet.unconfirmed == {7}
    assert texts(bench.say(heartbeat(), 0.1, system=7)) == [("link", "vehicle found")]
    assert bench.fleet.unconfirmed == set()
    gcs = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    bench.say(gcs, 0.1, system=254)
    bench.say(heartbeat(), 0.1, system=9, component=25)
    assert set(bench.fleet.vehicles) == {7}


def test_silence_is_noticed_and_so_is_its_end() -> None:
    bench = Bench(1, 2)
    bench.say(heartbeat(), 1.5, system=2)
    assert bench.fleet.handle_timer(LOST_S - 0.01) == []
    (lost,) = bench.fleet.handle_timer(LOST_S)
    assert (lost.system, lost.kind, lost.severity) == (1, "link", ERROR)
    assert bench.state(1).lost
    assert not bench.state(2).lost
    assert bench.state(1).age_s(2.5) == 2.5
    assert bench.fleet.handle_timer(2.1) == []
    (back,) = bench.say(tracking(1.0), 3.0)
    assert "link back after 3.0 s" in back.text
    assert not bench.state(1).lost


def test_heartbeat_tells_arming_and_mode() -> None:
    bench = Bench(1)
    state = bench.state()
    assert (state.armed, state.mode, state.is_ready) == (False, "LOITER", True)
    notifications = bench.say(heartbeat(ACTIVE, armed=True, mode=10), 0.5)
    assert texts(notifications) == [("mode", "armed"), ("mode", "mode LOITER → AUTO")]
    assert (state.armed, state.mode) == (True, "AUTO")
    assert bench.say(heartbeat(ACTIVE, armed=True, mode=10), 1.5) == []
    bench.say(heartbeat(BOOT, mode=3), 2.0)
    assert (state.is_ready, state.mode) == (False, "3")


def test_message_rate() -> None:
    bench = Bench(1)
    for i in range(100):
        bench.say(tracking(i / 50), i / 50)
    bench.fleet.handle_timer(2.0)
    assert bench.state().rate_hz(2.0) == pytest.approx(50.0, abs=1.0)
    assert bench.state().rate_hz(4.0) == 0.0


def test_while_disarmed_the_measured_motion_is_shown_without_a_reference() -> None:
    bench = Bench(1)
    bench.say(dialect.MAVLink_attitude_message(1500, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0), 0.1)
    bench.say(dialect.MAVLink_vfr_hud_message(31.0, 30.0, 0, 0, 0.0, 0.0), 0.1)
    none = [math.nan] * 4
    bench.say(dialect.MAVLink_ftc_tracking_message(1500, none, none, none), 0.1)
    row = bench.state().history.rows()[-1]
    assert row["actual"] == pytest.approx([31.0, *map(math.degrees, (0.1, 0.2, 0.3))], rel=1e-6)
    assert all(map(math.isnan, row["reference"]))
    status = vehicle_status(bench.state(), 0.1)
    assert status["actual"]["airspeed_m_s"] == 31.0
    for key in ("reference", "error", "sync_error"):
        assert set(status[key].values()) == {None}
    json.dumps(status, allow_nan=False)


def test_what_tracking_reports() -> None:
    bench = Bench(1)
    assert bench.state().reference is None
    assert bench.state().time_s is None
    bench.say(tracking(1.5), 0.1)
    held = dialect.MAVLink_actuator_output_status_message(
        0, 15, [0.25, 0.5, -0.5, 1.0, *[0.0] * 28]
    )
    bench.say(held, 0.2)
    bench.say(tracking(1.6, airspeed=46.0), 0.2)
    state = bench.state()
    assert state.time_s == 1.6
    assert state.reference == (46.0, 1.0, 2.0, 3.0)
    assert state.error == (0.5, 0.25, 0.0, -1.0)
    assert state.held == (0.25, 0.5, -0.5, 1.0)
    rows = state.history.rows()
    assert rows["time_s"].tolist() == [1.5, 1.6]
    assert rows["actual"][1].tolist() == [46.5, 1.25, 2.0, 2.0]
    assert math.isnan(rows["held"][0, 0])
    assert rows["held"][1].tolist() == [0.25, 0.5, -0.5, 1.0]
    assert len(state.history.rows(span_s=0.05)) == 1


@pytest.mark.parametrize("late", [False, True], ids=["booting", "missed"])
def test_a_restart_is_noticed(late: bool) -> None:
    bench = Bench(1)
    bench.say(events(30.0, 30_000, 100), 0.1)
    bench.state().learn_faults((FAULT,), 0.1)
    bench.state().learn_mission((), 0.1)
    if late:  # its first messages were lost: time went back and stays there
        assert bench.say(events(0.0, 0), 1.0) == []
        notifications = bench.say(events(0.0, 0), 2.1)
    else:
        notifications = bench.say(heartbeat(BOOT), 0.5)
    assert texts(notifications) == [("link", "vehicle was restarted")]
    state = bench.state()
    assert state.restarts == 1
    assert (state.faults, state.profile, state.counts.total) == (None, None, 0)
    assert state.is_asking_due(2.2)


def test_an_autopilot_restarted_in_flight_counts_from_zero() -> None:
    bench = Bench(1)
    bench.say(events(30.0, 30_000, 100), 0.1)
    assert texts(bench.say(events(31.0, 200, 5), 0.2)) == [("link", "vehicle was restarted")]
    assert bench.state().counts.total == 5


def test_late_messages_are_no_restart() -> None:
    bench = Bench(1)
    for now in (0.1, 1.2, 2.3):
        bench.say(events(30.0 + now, 30_000, 100), now)
        bench.say(events(29.8 + now, 29_800, 99), now)
        bench.say(tracking(29.9 + now), now)
    assert bench.state().restarts == 0
    assert bench.state().counts.total == 100


def test_texts_are_assembled_and_logged() -> None:
    bench = Bench(1)
    long = "neighbour 2 silent, edge dropped, and so on and so forth for long"
    first, second = text_chunks(WARNING, long, 3)
    assert bench.say(first, 0.0) == []
    (notifications,) = bench.say(second, 0.1)
    assert (notifications.kind, notifications.severity, notifications.text) == (
        "text",
        WARNING,
        long,
    )
    heard = bench.state().texts_heard
    bench.say(text_chunks(WARNING, "short", 4)[0], 0.2)
    assert [text.text for text in bench.state().texts_since(heard)] == ["short"]
    assert bench.state().texts_since(heard + 1) == []


def ack(command: int, result: int = 0) -> MAVLink_message:
    return dialect.MAVLink_command_ack_message(command, result, 0, 0, 254, 1)


def test_acks_are_logged_whoever_they_are_for() -> None:
    bench = Bench(1)
    (notifications,) = bench.say(ack(dialect.MAV_CMD_MISSION_START, dialect.MAV_RESULT_DENIED), 0.1)
    assert (notifications.kind, notifications.severity, notifications.text) == (
        "ack",
        WARNING,
        "MISSION_START: DENIED",
    )
    assert notifications.about.target_system == 254
    assert bench.say(ack(dialect.MAV_CMD_REQUEST_MESSAGE), 0.1) == []
    refused = dialect.MAVLink_mission_ack_message(255, 190, dialect.MAV_MISSION_DENIED, 0)
    assert texts(bench.say(refused, 0.1)) == [("ack", "mission: DENIED")]


def test_faults_are_asked_for_at_first_and_whenever_they_may_have_changed() -> None:
    bench = Bench(1)
    state = bench.state()
    assert state.is_asking_due(0.0)
    state.learn_mission((), 0.0)
    assert state.is_asking_due(0.0)
    state.learn_areas(FENCE, (), 0.0)
    assert state.learn_faults((), 0.0) == []
    assert not state.is_asking_due(1.0)
    bench.say(ack(dialect.MAV_CMD_FTC_SET_FAULT), 1.0)
    assert state.is_asking_due(1.0)
    (notifications,) = state.learn_faults((FAULT,), 1.1)
    assert texts([notifications]) == [("faults", "faults: rudder at 90 % in (19, 22] s")]
    assert state.learn_faults((FAULT,), 1.2) == []
    assert texts(state.learn_faults((), 1.3)) == [("faults", "faults: none")]
    assert not state.is_asking_due(1.5)
    assert state.is_asking_due(7.0)  # whoever set one, its ack may have been lost
    assert state.learn_faults(None, 7.0) == []
    assert state.faults == ()
    bench.fleet.handle_timer(8.0)
    assert not state.is_asking_due(10.0)  # not while the link is lost


def test_the_profile_is_asked_for_again_when_someone_uploaded_one() -> None:
    bench = Bench(1)
    state = bench.state()
    state.learn_faults((), 0.0)
    state.learn_areas(FENCE, (), 0.0)
    segment = Segment(0.0, 40.0, 0.0, 0.0, 0.0, ramp=False)
    assert texts(state.learn_mission(tuple(segments_to_items([segment], 1, 1)), 0.0)) == [
        ("profile", "holds profile of 1 segments")
    ]
    assert not state.is_asking_due(1.0)
    bench.say(dialect.MAVLink_mission_ack_message(254, 1, dialect.MAV_MISSION_ACCEPTED, 0), 1.0)
    assert state.is_asking_due(1.0)


def test_fence_and_rally_points_are_asked_for_again_when_someone_uploaded_some() -> None:
    bench = Bench(1)
    state = bench.state()
    state.learn_faults((), 0.0)
    state.learn_mission((), 0.0)
    circle = mission_item(0, dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, (80.0,))
    assert texts(state.learn_areas(FENCE, (circle,), 0.0)) == [("profile", "holds fence of 1 item")]
    assert state.learn_areas(FENCE, (circle,), 0.0) == []
    assert state.learn_areas(RALLY, (), 0.0) == []
    assert not state.is_asking_due(1.0)
    bench.say(dialect.MAVLink_mission_ack_message(254, 1, dialect.MAV_MISSION_ACCEPTED, 1), 1.0)
    assert state.is_asking_due(1.0)
    assert texts(state.learn_areas(FENCE, (), 1.0)) == [("profile", "holds no fence")]
    assert state.areas == {FENCE: (), RALLY: ()}


def test_the_profile_is_asked_for_again_when_its_length_is_another_one() -> None:
    bench = Bench(1)
    state = bench.state()
    state.learn_faults((), 0.0)
    state.learn_mission((), 0.0)
    state.learn_areas(FENCE, (), 0.0)
    for seq, total, is_due in ((1, 3, False), (2, 3, False), (2, 5, True)):
        bench.say(dialect.MAVLink_mission_current_message(seq, total), 1.0)
        assert state.is_asking_due(1.0) == is_due


@pytest.mark.parametrize(("time_s", "active"), [(19.0, 0), (19.1, 1), (22.0, 1), (22.1, 0)])
def test_which_faults_act(time_s: float, active: int) -> None:
    bench = Bench(1)
    bench.state().learn_faults((FAULT,), 0.0)
    bench.say(tracking(time_s), 0.1)
    assert len(bench.state().active_faults) == active


def counts_of(*messages: Any) -> EventCounts:
    counts = EventCounts()
    for message in messages:
        counts.receive(message)
    return counts


def test_counts_before_any_step() -> None:
    counts = counts_of(events(0.0, 0))
    assert (counts.saving, counts.savings) == (None, (None,) * 4)
    assert counts.rates(3).tolist() == [[0.0] * 4] * 3
    assert EventCounts().recent() == (0, 0, 0, 0)
    assert EventCounts().rates(2).shape == (2, 4)


def test_savings_and_smallest_intervals() -> None:
    counts = counts_of(events(1.0, 1000, 250, 100, 50, 0, shortest=3000))
    assert counts.savings == (0.75, 0.9, 0.95, 1.0)
    assert counts.saving == pytest.approx(0.9)
    assert counts.min_interval_s == (0.003,) * 4
    assert counts_of(events(1.0, 1000, 1)).min_interval_s == (None,) * 4


def test_events_of_the_last_ten_seconds() -> None:
    counts = counts_of(*(events(t, 1000 * t, 10 * t, t) for t in range(31)))
    assert counts.recent() == (100, 10, 0, 0)
    assert counts.recent(window_s=2.0) == (20, 2, 0, 0)
    assert counts_of(events(5.0, 5000, 50), events(6.0, 6000, 57)).recent() == (7, 0, 0, 0)


def test_rates() -> None:
    counts = counts_of(
        *(events(t, 1000 * t, 10 * t if t < 20 else 20 * t - 200) for t in range(31))
    )
    assert counts.rates(bins=30)[:, 0].tolist() == [10.0] * 20 + [20.0] * 10
    assert counts.rates(bins=3, bin_s=10.0)[:, 0].tolist() == [10.0, 10.0, 20.0]


def test_totals_of_the_fleet() -> None:
    bench = Bench(1, 2)
    assert bench.fleet.saving is None
    bench.say(events(1.0, 1000, 400), 0.1, system=1)
    bench.say(events(1.0, 1000, 0), 0.1, system=2)
    assert bench.fleet.events == 400
    assert bench.fleet.saving == pytest.approx(0.95)


def test_history_keeps_the_newest_rows() -> None:
    history = History()
    assert len(history.rows(1.0)) == 0
    four = (0.0,) * 4
    for i in range(6500):
        history.add((i / 10, four, four, four, four, four, four, four[:3]))
    rows = history.rows()
    assert len(history) == len(rows) == 6000
    assert (rows["time_s"][0], rows["time_s"][-1]) == (50.0, 649.9)
    assert (rows["time_s"][1:] > rows["time_s"][:-1]).all()


def test_a_diagnosis_is_known_once_a_law_has_one() -> None:
    state = VehicleState(SystemId(3, 1), 0.0)
    four = [1.0] * 4
    unknown = [dialect.FTC_PHASE_UNKNOWN] * 4
    assert state.diagnosis is None
    state.receive(dialect.MAVLink_ftc_diagnosis_message(0, four, four, four, unknown), 1.0)
    assert state.diagnosis is None
    state.receive(dialect.MAVLink_ftc_diagnosis_message(0, four, four, four, [0, 0, 2, 0]), 2.0)
    assert state.diagnosis == (0, 0, 2, 0)


def test_only_private_messages_tell_simulated_time() -> None:
    """Time since boot flows before the flight; neither clock passes for the other."""
    bench = Bench(1)
    bench.say(dialect.MAVLink_system_time_message(10**15, 90_000), 0.0)
    state = bench.fleet.vehicles[1]
    before = state.time_s
    assert before is None
    bench.say(events(0.0, 0), 0.1)
    assert state.time_s == 0.0
    for k in range(30):
        now = 0.2 + 0.1 * k
        bench.say(dialect.MAVLink_system_time_message(10**15, 90_000 + 100 * k), now)
        bench.say(events(0.1 * k, 100 * k), now)
    assert state.restarts == 0
    assert state.time_s == pytest.approx(2.9)

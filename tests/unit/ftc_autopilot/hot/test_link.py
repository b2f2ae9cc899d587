"""The autopilot's link to the plant over real loopback sockets, one state at a time."""

import math
import time

import numpy as np
import pytest
from link_bench import LOCKSTEP, UAV, Rig

from ftc_autopilot.control import controllers
from ftc_autopilot.control.controller import restart_law
from ftc_autopilot.control.controllers import reset_controllers
from ftc_autopilot.control.edges import EDGE
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.hot.acknowledgement import ACKNOWLEDGEMENT
from ftc_autopilot.hot.drops import SIMULATOR
from ftc_autopilot.hot.state import reset_links
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
)
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.hot_link import ReturnReason


def test_a_lockstep_step_is_answered_with_actuators_then_step_done(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    assert rig.state(0) == ReturnReason.TICK
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert set(rig.heard(rig.neighbour)) == {codec.MessageId.NEIGHBOUR}


def test_real_time_has_no_step_done(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS]


def test_a_frozen_aircraft_sends_the_plant_nothing(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_LOCKSTEP)
    assert rig.heard(rig.plant) == []
    assert rig.heard(rig.neighbour) == [codec.MessageId.NEIGHBOUR]


def test_without_an_event_only_step_done_is_sent(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.no_more_events()
    rig.heard(rig.plant)
    for step in range(1, 200):
        rig.send_neighbour_state(step)
        rig.state(step)
        assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]
    assert rig.controllers.uavs[0]["controller"]["events"].tolist() == [1, 1, 1, 1]


def test_the_same_state_again_is_answered_but_not_worked_on_again(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.heard(rig.plant)
    rig.state(0)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]
    assert rig.controllers.uavs[0]["controller"]["steps"] == 1


def test_disarmed_it_measures_holds_and_computes_nothing(rig: Rig) -> None:
    for step in range(20):
        rig.send_neighbour_state(step)
        rig.state(step)
    controller, signals = rig.controllers.uavs[0]["controller"], rig.controllers.uavs[0]["signals"]
    before, held = controller.copy(), signals["held"].copy()
    rig.controllers.uavs[0]["guidance"]["active"] = 0
    for step in range(20, 40):
        rig.send_neighbour_state(step)
        rig.state(step)
    assert signals["V"] == pytest.approx(math.hypot(40.0, 0.5))
    assert signals["attitude"].tolist() == [0.0, math.radians(1.0), 0.0]
    assert signals["held"].tolist() == [*held[:3], 0.0]
    for name in ("command", "reference", "error", "sync_error", "demand", "beta_v"):
        assert np.isnan(signals[name]).all()
    assert controller["steps"] == before["steps"] == 20
    assert (controller["events"] - before["events"]).tolist() == [0, 0, 0, 1]
    assert controller["messages"] == before["messages"] + 1


def test_armed_again_the_law_starts_from_where_the_aircraft_is(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    assert (
        rig.controllers.uavs[0]["signals"]["reference"].tolist()
        == rig.controllers.uavs[0]["signals"]["command"].tolist()
    )
    controller = rig.controllers.uavs[0]["controller"]
    controller["proposed"]["beta_v"] = 7.0
    restart_law(controller)
    rig.state(50)
    signals = rig.controllers.uavs[0]["signals"]
    assert signals["reference"].tolist() == [signals["V"], *signals["attitude"]]
    assert signals["beta_v"] == 1.0
    assert signals["events"] == 0b1111
    assert controller["min_interval"].tolist() == [50] * 4


def test_a_lost_actuator_message_is_sent_again_and_counted_apart(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    events = rig.controllers.uavs[0]["controller"]["events"].copy()
    rig.no_more_events()
    rig.heard(rig.plant)
    rig.send_neighbour_state(1)
    rig.state(1, applied_usec=-1)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert list(rig.autopilots.own[0]["link"]["repeated"]) == [1, 1, 1, 1]
    assert np.array_equal(rig.controllers.uavs[0]["controller"]["events"], events)
    rig.send_neighbour_state(2)
    rig.state(2)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]


def pending(rig: Rig) -> list[int]:
    return [int(usec) for usec in rig.autopilots.own[0]["link"]["pending_usec"]]


def test_an_event_is_acknowledged_by_its_message_or_a_later_one(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_RUNNING, applied_usec=-1)
    assert pending(rig) == [0, 0, 0, 0]
    rig.no_more_events()
    rig.autopilots.own[0]["link"]["pending_usec"] = [
        0,
        0,
        1000,
        2000,
    ]  # the rudder's and throttle's came later
    rig.autopilots.own[0]["link"]["deviation"] = 1e6  # nobody is impatient
    rig.state(3, FTC_SIM_FLAGS_RUNNING, applied_usec=0)
    assert pending(rig) == [-1, -1, 1000, 2000]
    rig.state(4, FTC_SIM_FLAGS_RUNNING, applied_usec=5000)
    assert pending(rig) == [-1, -1, -1, -1]
    assert list(rig.autopilots.own[0]["link"]["repeated"]) == [0, 0, 0, 0]


def test_a_lost_message_repeats_the_events_of_its_own_channels_only(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.no_more_events()
    rig.autopilots.own[0]["link"]["pending_usec"] = [
        -1,
        500,
        0,
        -1,
    ]  # elevator and, applied already, rudder
    rig.send_neighbour_state(1)
    rig.state(1, applied_usec=0)
    assert list(rig.autopilots.own[0]["link"]["repeated"]) == [0, 1, 0, 0]


REAL_TIME = FTC_SIM_FLAGS_RUNNING


def repeats(rig: Rig) -> list[int]:
    return [int(number) for number in rig.autopilots.own[0]["link"]["repeated"]]


def test_in_real_time_an_event_is_sent_again_two_periods_after_it_should_act(rig: Rig) -> None:
    rig.state(0, REAL_TIME)
    rig.no_more_events()
    for step, expected in ((1, 0), (2, 0), (3, 1), (4, 1), (5, 1), (6, 2)):
        rig.heard(rig.plant)
        rig.state(step, REAL_TIME, applied_usec=-1)
        assert rig.heard(rig.plant) == ([codec.MessageId.ACTUATORS] if step in {3, 6} else [])
        assert repeats(rig) == [expected] * 4
    assert pending(rig) == [0, 0, 0, 0]  # the first message would acknowledge them still
    rig.state(7, REAL_TIME, applied_usec=0)
    assert pending(rig) == [-1, -1, -1, -1]


def with_events_in_every_step(rig: Rig) -> None:
    rig.controllers.uavs["parameters"]["mode"] = MODES.index("periodic")


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_the_delay_follows_from_the_acknowledgements(rig: Rig, delay: int) -> None:
    with_events_in_every_step(rig)
    for step in range(60):
        applied = step - 1 - delay
        rig.state(step, REAL_TIME, applied_usec=1000 * applied if applied >= 0 else -1)
    assert rig.autopilots.own[0]["link"]["delay"] == pytest.approx(delay)
    assert rig.controllers.uavs[0]["delay"]["periods"] == delay


def test_states_that_were_lost_do_not_lengthen_the_delay(rig: Rig) -> None:
    """After a gap, a message that the state shows may have acted for some periods."""
    with_events_in_every_step(rig)
    for step in range(60):
        if step % 5 not in {1, 2}:
            rig.state(step, REAL_TIME, applied_usec=1000 * (step - 1) if step else -1)
    assert rig.autopilots.own[0]["link"]["delay"] == 0.0


def test_a_slow_link_is_given_its_time_before_an_event_is_sent_again(rig: Rig) -> None:
    with_events_in_every_step(rig)
    for step in range(100):
        rig.state(step, REAL_TIME, applied_usec=1000 * (step - 31) if step > 30 else -1)
    rig.no_more_events()
    rig.controllers.uavs["parameters"]["mode"] = MODES.index("per_channel")
    before = repeats(rig)
    for step in range(100, 130):
        rig.state(step, REAL_TIME, applied_usec=1000 * (step - 31))
    assert repeats(rig) == before
    assert pending(rig) == [99000] * 4
    for step in range(130, 150):
        rig.state(step, REAL_TIME, applied_usec=98000)
    assert min(repeats(rig)) > min(before)


def test_lockstep_has_no_delay(rig: Rig) -> None:
    with_events_in_every_step(rig)
    for step in range(10):
        rig.send_neighbour_state(step)
        rig.state(step, applied_usec=1000 * (step - 4) if step > 3 else -1)
    assert rig.controllers.uavs[0]["delay"]["periods"] == 0


def test_a_step_that_was_not_flown_is_not_reported_done(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(5)
    rig.heard(rig.plant)
    rig.state(3)
    assert rig.heard(rig.plant) == []


@pytest.mark.parametrize(
    "flags",
    [
        LOCKSTEP,
        FTC_SIM_FLAGS_RUNNING,
        FTC_SIM_FLAGS_LOCKSTEP,
        FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED,
    ],
)
def test_a_state_of_another_run_is_not_worked_on(rig: Rig, flags: int) -> None:
    for step in range(3):
        rig.send_neighbour_state(step)
        rig.state(step)
    rig.heard(rig.plant)
    rig.heard(rig.neighbour)
    for step in (0, 3):
        assert rig.state(step, flags, run=8 + step) == ReturnReason.RESTARTED
    assert rig.heard(rig.plant) == rig.heard(rig.neighbour) == []
    assert rig.controllers.uavs[0]["controller"]["steps"] == 3


def test_after_a_reset_nothing_is_left_of_the_flight(scenario1: Scenario, rig: Rig) -> None:
    for step in range(20):
        rig.send_neighbour_state(step)
        rig.state(step, applied_usec=-1)
    fresh = Rig(scenario1)
    reset_links(rig.autopilots)
    reset_controllers(rig.controllers)
    reset_controllers(fresh.controllers)  # its guidance, too, is set again by the modes
    for name in controllers.UAV.names or ():
        both = rig.controllers.uavs[name], fresh.controllers.uavs[name]
        assert both[0].tobytes() == both[1].tobytes(), name
    for name in set(EDGE.names or ()) - {"address", "pending"}:
        both = rig.controllers.edges[name], fresh.controllers.edges[name]
        assert both[0].tobytes() == both[1].tobytes(), name
    assert rig.autopilots.own["link"]["recorded"] == 0
    both = rig.autopilots.own["formation"], fresh.autopilots.own["formation"]
    assert both[0]["edge_changes"] == both[1]["edge_changes"]
    for name in ("step", *(field[0] for field in ACKNOWLEDGEMENT)):
        assert (
            rig.autopilots.own["link"][name].tobytes()
            == fresh.autopilots.own["link"][name].tobytes()
        ), name
    fresh.close()


_FALSE_CRC = b"\xfd" + bytes(6) + codec.MessageId.STEP_DONE.to_bytes(3, "little") + b"no"


@pytest.mark.parametrize(
    ("noise", "reason"),
    [
        (b"", DropReason.TRUNCATED),
        (b"noise", DropReason.BAD_MAGIC),
        (bytes(300), DropReason.BAD_MAGIC),
        (b"\xfd" + bytes(10), DropReason.TRUNCATED),
        (
            b"\xfd" + bytes(6) + codec.MessageId.STEP_DONE.to_bytes(3, "little") + b"no",
            DropReason.BAD_CRC,
        ),
    ],
)
def test_noise_changes_nothing_and_is_counted(rig: Rig, noise: bytes, reason: DropReason) -> None:
    rig.plant.sendto(noise, rig.own.getsockname())
    assert rig.run() == ReturnReason.TICK
    assert rig.autopilots.own[0]["link"]["step"] == -1
    expected = np.zeros_like(rig.autopilots.own[0]["drops"])
    expected[SIMULATOR, -reason] = 1
    assert rig.autopilots.own[0]["drops"].tolist() == expected.tolist()


def test_a_frame_that_only_python_parses_asks_for_service(rig: Rig) -> None:
    heartbeat = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
    rig.plant.sendto(FramePacker(UAV, 1).pack(heartbeat), rig.own.getsockname())
    assert rig.run() == ReturnReason.SERVICE
    assert rig.autopilots.own[0]["link"]["step"] == -1
    assert not rig.autopilots.own["drops"].any()


def test_in_lockstep_a_message_of_a_ground_station_is_not_kept_waiting(rig: Rig) -> None:
    rig.state(1)
    rig.plant.sendto(b"request", rig.gcs.getsockname())
    until_s = time.monotonic() + 3600.0
    assert rig.run(until_s) == ReturnReason.TICK
    assert time.monotonic() < until_s
    assert rig.gcs.recv(100) == b"request"


def test_before_the_start_a_message_of_a_ground_station_is_not_kept_waiting(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_LOCKSTEP)
    rig.plant.sendto(b"request", rig.gcs.getsockname())
    until_s = time.monotonic() + 3600.0
    assert rig.run(until_s) == ReturnReason.TICK
    assert time.monotonic() < until_s


def test_before_the_start_a_busy_ground_station_does_not_keep_the_plant_waiting(rig: Rig) -> None:
    for _ in range(10):
        rig.plant.sendto(b"request", rig.gcs.getsockname())
    assert rig.state(0, FTC_SIM_FLAGS_LOCKSTEP) == ReturnReason.TICK
    assert rig.autopilots.own[0]["link"]["heard_s"] > 0.0


def test_the_end_of_the_simulation_is_acknowledged(rig: Rig) -> None:
    assert rig.state(0, FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED) == ReturnReason.OVER
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]


def test_disarmed_in_flight_thrust_goes_to_zero_once(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    assert rig.controllers.uavs[0]["actuators"]["controls"][3] > 0.0
    rig.controllers.uavs[0]["guidance"]["active"] = 0
    rig.heard(rig.plant)
    rig.send_neighbour_state(1)
    rig.state(1)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert rig.controllers.uavs[0]["actuators"]["controls"][3] == 0.0
    rig.send_neighbour_state(2)
    rig.state(2)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]

"""Real time: what an autopilot makes of datagrams that waited while it had no processor time."""

import contextlib
import math
import socket
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from link_bench import NEIGHBOUR, TIMEOUT_STEPS, Rig

from ftc_autopilot.hot.drops import FORMATION, SIMULATOR
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.old_states import OldStates
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import OLD_STATE_S
from mavlink_defs.dialect import FTC_SIM_FLAGS_ENDED, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.hot_link import ReturnReason

REAL_TIME = FTC_SIM_FLAGS_RUNNING
ABSURD_STEP = 2**32 - 1
LAST_BEFORE = 5
"""Last step before the autopilot has no time."""

heartbeat = FramePacker(2, 25).pack(dialect.MAVLink_heartbeat_message(0, 0, 0, 0, 0, 3))
others = st.sampled_from([heartbeat, b"", b"anything", b"\xfd" + bytes(300)])
queues = st.lists(st.integers(0, 300) | others, min_size=1, max_size=30)


@contextlib.contextmanager
def flying(scenario: Scenario) -> Iterator[Rig]:
    """An autopilot that has flown some steps in real time, and heard its neighbour in each."""
    rig = Rig(scenario)
    try:
        for step in range(LAST_BEFORE + 1):
            rig.send_neighbour_state(step)
            rig.state(step, REAL_TIME)
        yield rig
    finally:
        rig.close()


def run_until_nothing_waits(rig: Rig) -> list[ReturnReason]:
    outcomes = [rig.run()]
    while outcomes[-1] == ReturnReason.SERVICE:
        outcomes.append(rig.run())
    return outcomes


def oldest_steps(rig: Rig) -> int:
    return HotState(rig.autopilots).oldest_state_us // 1000


def squeeze(sock: socket.socket) -> None:
    """Give a socket the smallest receive buffer."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)


@given(queues)
def test_of_all_states_that_wait_the_newest_is_acted_on(
    scenario1: Scenario, queue: list[int | bytes]
) -> None:
    with flying(scenario1) as rig:
        for item in queue:
            if isinstance(item, bytes):
                rig.plant.sendto(item, rig.own.getsockname())
            else:
                rig.send_state(item, REAL_TIME)
        run_until_nothing_waits(rig)
        newest = max([LAST_BEFORE, *(item for item in queue if isinstance(item, int))])
        state, law = rig.autopilots.own[0]["link"], rig.controllers.uavs[0]["controller"]
        assert state["step"] == newest == rig.autopilots.own[0]["measured"]["step"]
        assert law["steps"] == LAST_BEFORE + 1 + (newest > LAST_BEFORE)  # the others are missed
        assert oldest_steps(rig) == max(newest - LAST_BEFORE, 1)
        assert np.isfinite(rig.controllers.uavs[0]["actuators"]["controls"]).all()
        assert rig.autopilots.own[0]["drops"][SIMULATOR].sum() == sum(
            isinstance(item, bytes) and item != heartbeat for item in queue
        )


def test_in_lockstep_each_state_is_worked_on(scenario1: Scenario) -> None:
    rig = Rig(scenario1)
    for step in range(4):
        rig.send_neighbour_state(step)
        rig.send_state(step)
    for _ in range(4):
        rig.run()
    assert rig.controllers.uavs[0]["controller"]["steps"] == 4
    assert oldest_steps(rig) == 0
    rig.close()


def test_the_end_is_not_passed_over(scenario1: Scenario) -> None:
    with flying(scenario1) as rig:
        rig.send_state(7, FTC_SIM_FLAGS_ENDED)
        rig.send_state(0, REAL_TIME, run=8)
        assert rig.run() == ReturnReason.OVER
        assert rig.run() == ReturnReason.RESTARTED


@given(st.integers(1, 400))
def test_the_age_belongs_to_the_newest_state_that_the_plant_has_sent(
    scenario1: Scenario, sent: int
) -> None:
    """Whether the socket held all of them or only the first."""
    with flying(scenario1) as rig:
        squeeze(rig.own)
        for step in range(LAST_BEFORE + 1, LAST_BEFORE + 1 + sent):
            rig.send_state(step, REAL_TIME)
        rig.run()
        assert rig.autopilots.own[0]["link"]["step"] <= LAST_BEFORE + sent
        assert oldest_steps(rig) == sent
        before = rig.autopilots.own[0]["link"]["step"]
        rig.state(LAST_BEFORE + 1 + sent, REAL_TIME)
        assert rig.autopilots.own[0]["link"]["step"] == LAST_BEFORE + 1 + sent
        assert oldest_steps(rig) == max(sent, LAST_BEFORE + 1 + sent - before)


def test_an_old_state_is_forgotten_in_two_seconds(scenario1: Scenario) -> None:
    with flying(scenario1) as rig:
        rig.state(500, REAL_TIME)
        assert oldest_steps(rig) == 495
        ages = []
        for step in range(501, 2700):
            rig.state(step, REAL_TIME)
            ages.append(oldest_steps(rig))
        assert ages[:990] == [495] * 990
        assert ages[-100:] == [1] * 100


def test_what_is_no_gap_has_no_age(scenario1: Scenario) -> None:
    """The first state, a plant that stands still, one that was started again."""
    with flying(scenario1) as rig:
        assert oldest_steps(rig) == 1
        rig.state(LAST_BEFORE, REAL_TIME)
        assert oldest_steps(rig) == 1
        rig.state(0, REAL_TIME, run=8)
        HotState(rig.autopilots).reset()
        assert oldest_steps(rig) == 0
        rig.state(700, REAL_TIME, run=8)
        assert oldest_steps(rig) == 0


def test_an_episode_is_reported_once_and_its_end(scenario1: Scenario) -> None:
    with flying(scenario1) as rig:
        reported = OldStates(HotState(rig.autopilots))
        assert list(reported.changes()) == []
        rig.state(LAST_BEFORE + round(OLD_STATE_S * 1000), REAL_TIME)
        assert list(reported.changes()) == []
        rig.state(317, REAL_TIME)
        ((_, severity, text),) = reported.changes()
        assert severity == dialect.MAV_SEVERITY_WARNING
        assert "0.212 s old" in text
        rig.state(900, REAL_TIME)
        assert list(reported.changes()) == []
        for step in range(901, 3000):
            rig.state(step, REAL_TIME)
        ((_, severity, text),) = reported.changes()
        assert severity == dialect.MAV_SEVERITY_NOTICE
        assert "0.583 s old" in text
        assert list(reported.changes()) == []


# neighbours


@settings(max_examples=25)
@given(missed=st.integers(0, 3000), ahead=st.integers(-3, 200), small=st.booleans())
def test_a_neighbour_that_talks_stays_and_is_not_out_of_range(
    scenario1: Scenario, missed: int, ahead: int, small: bool
) -> None:
    with flying(scenario1) as rig:
        if small:  # the newest messages are lost
            squeeze(rig.formation)
        last = LAST_BEFORE + missed
        for step in range(LAST_BEFORE + 1, last + ahead):
            rig.send_neighbour_state(step)
        rig.state(last, REAL_TIME)
        for step in range(last + 1, last + 300):
            rig.send_neighbour_state(step + ahead)
            rig.state(step, REAL_TIME)
        assert rig.autopilots.own[0]["formation"]["edge_changes"] == 0
        assert rig.autopilots.own[0]["drops"][FORMATION, -DropReason.OUT_OF_RANGE] == 0
        in_use = rig.controllers.edges[0, 0]["message"]["step"]
        assert in_use == last + 299 + ahead


def test_while_the_plant_was_not_heard_a_neighbour_may_have_gone_on(scenario1: Scenario) -> None:
    """Kept waiting between two looks at its sockets, an autopilot meets states of the future."""
    with flying(scenario1) as rig:
        rig.send_neighbour_state(5000)
        rig.autopilots.own[0]["formation"]["most_steps_per_s"] = 1e12
        rig.state(LAST_BEFORE + 1, REAL_TIME)
        assert rig.controllers.edges[0, 0]["message"]["step"] == 5000
        rig.send_neighbour_state(7)
        rig.state(LAST_BEFORE + 2, REAL_TIME)
        assert rig.controllers.edges[0, 0]["message"]["step"] == 7
        assert rig.autopilots.own[0]["drops"][FORMATION].sum() == 0


@pytest.mark.parametrize("missed", [0, 1000])
def test_an_absurd_step_is_not_believed(scenario1: Scenario, missed: int) -> None:
    with flying(scenario1) as rig:
        rig.send_neighbour_state(ABSURD_STEP)
        rig.send_neighbour_state(6)
        rig.state(LAST_BEFORE + 1 + missed, REAL_TIME)
        assert rig.autopilots.own[0]["drops"][FORMATION, -DropReason.OUT_OF_RANGE] == 1
        assert rig.controllers.edges[0, 0]["message"]["step"] == 6
        assert math.isfinite(rig.controllers.uavs[0]["controller"]["held"].sum())


@pytest.mark.parametrize("missed", [0, 1000])
def test_a_neighbour_that_repeats_itself_is_silent(scenario1: Scenario, missed: int) -> None:
    with flying(scenario1) as rig:
        first = LAST_BEFORE + missed
        for step in range(first, first + TIMEOUT_STEPS + 10):
            rig.send_neighbour_state(LAST_BEFORE, system=NEIGHBOUR)
            rig.state(step, REAL_TIME)
        assert rig.controllers.edges[0, 0]["edge"] == 0


# commands


def test_a_command_made_before_a_gap_tells_nothing_of_the_delay(scenario1: Scenario) -> None:
    with flying(scenario1) as rig:
        state = rig.autopilots.own[0]["link"]
        rig.state(6, REAL_TIME, applied_usec=-1)
        state["applied_usec"] = -1
        rig.state(600, REAL_TIME, applied_usec=-1)
        before = float(state["delay"])
        rig.state(601, REAL_TIME, applied_usec=6000)
        assert state["delay"] == before
        rig.state(602, REAL_TIME, applied_usec=600_000)
        assert state["delay"] != before

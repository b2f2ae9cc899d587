"""Consensus on the path position, and when a member counts as being in trouble."""

from typing import Any

import numpy as np
import pytest
from edges import edges_of
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.diagnosis import LOST as LOST_ACTUATOR
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.guidance.coordination import (
    Coordination,
    Progress,
    coordinate,
    new_formation,
)
from ftc_autopilot.guidance.formation import Formation, FormationParameters, layout_record
from ftc_autopilot.guidance.members import (
    DEGRADED,
    LEAVE,
    LOST,
    NOMINAL,
    SILENT,
    SLOW,
    WIDEN,
    cause_of,
    enter,
    policy_of,
)
from mavlink_defs.framing.codec import NEIGHBOUR

DT, TICK = 0.001, 0.02
SPEED = 40.0
SLOTS: dict[int, Any] = {1: {}, 2: {"ahead_m": -30.0}, 3: {"ahead_m": -60.0}}


class Member:
    """UAV 2, between UAVs 1 and 3, which are where the test puts them."""

    def __init__(self, access: float = 0.0, **keys: Any) -> None:
        formation = Formation.model_validate({"slots": SLOTS, **keys})
        self.gains: np.void = np.zeros(1, record_dtype(FormationParameters))[0]
        fill(self.gains, formation)
        self.layout = layout_record(formation, 2, access, {1: 1.0, 3: 1.0})
        self.state = new_formation()
        self.signals: np.void = np.zeros(1, SIGNALS)[0]
        self.edges = edges_of(np.zeros(2, NEIGHBOUR))
        self.known, self.weights = self.edges["known"], self.edges["weight"]
        self.known["path_id"], self.known["path_rate"] = 7, SPEED
        self.step = 0

    def update(self, xi: float, *others: float, since: float = TICK) -> Coordination:
        """Make an update with the own ξ and the neighbours', sent in the step before."""
        self.known["path_position"] = np.array(others) - SPEED * DT
        self.known["step"] = self.step - 1 if self.step else 0
        if self.step == 0:
            self.known["path_position"] = others
        now = Progress(self.step, DT, since, self.step * DT, True, 7, xi - 30.0, SPEED, SPEED)
        self.step += round(TICK / DT)
        return coordinate(
            now,
            self.edges,
            self.signals,
            self.layout,
            self.gains,
            self.state,
        )

    def wait(self, time_s: float, *xis: float) -> None:
        for _ in range(round(time_s / TICK)):
            self.update(*xis)

    @property
    def own(self) -> tuple[int, int]:
        entry = self.state["table"][1]
        return cause_of(entry), policy_of(entry)


@given(*[st.floats(-500.0, 500.0)] * 3)
def test_the_correction_obeys_the_equation(xi: float, first: float, third: float) -> None:
    member = Member()
    ks, limit = member.gains["ks"], member.gains["speed_limit_m_s"]
    expected = min(max(ks * ((first - xi) + (third - xi)) / 2.0, -limit), limit)
    assert member.update(xi, first, third, since=0.0).speed == pytest.approx(expected, abs=1e-9)


def test_neighbours_on_other_paths_silent_or_gone_do_not_count() -> None:
    for change in ("path", "silent", "gone"):
        member = Member()
        member.update(0.0, 0.0, 0.0, since=0.0)
        if change == "path":
            member.known["path_id"][0] = 8
        elif change == "silent":
            member.weights[0] = 0.0
        else:
            enter(member.state["table"], 0, 4 * LOST + LEAVE)
        assert member.update(0.0, 10.0, 0.0).speed == pytest.approx(0.0, abs=1e-9)


def test_a_neighbour_has_gone_on_since_its_message() -> None:
    member = Member()
    member.step = 100
    member.known["path_position"], member.known["step"] = 0.0, 50
    now = Progress(100, DT, 0.0, 0.1, True, 7, -30.0 + 50 * DT * SPEED, SPEED, SPEED)
    result = coordinate(
        now,
        member.edges,
        member.signals,
        member.layout,
        member.gains,
        member.state,
    )
    assert result.speed == pytest.approx(0.0, abs=1e-9)


def test_the_virtual_point_moves_at_the_missions_speed_and_waits() -> None:
    member = Member(access=1.0)
    xi = 0.0
    for _ in range(1000):
        member.update(xi, xi, xi)
        xi += SPEED * TICK
    assert member.state["virtual"] == pytest.approx(xi, abs=1e-6)
    for _ in range(3000):  # held up by something
        speed = member.update(xi, xi, xi).speed
        xi += (SPEED - 10.0) * TICK
    assert speed > 0.0
    farthest = member.gains["speed_limit_m_s"] / member.gains["ks"]
    assert member.state["virtual"] - xi == pytest.approx(farthest, abs=0.5)


def test_leaders_of_followers_wait_for_nobody() -> None:
    leader, follower = (Member(access=access, kind="leader_follower") for access in (1.0, 0.0))
    for member, expected in ((leader, 0.0), (follower, -3.0)):
        assert member.update(0.0, -10.0, -10.0, since=0.0).speed == pytest.approx(expected)


def test_one_slow_member_slows_all() -> None:
    member = Member(slow_share=0.2)
    member.update(0.0, 0.0, 0.0, since=0.0)
    member.known["path_rate"] = 0.8 * SPEED
    enter(member.state["table"], 2, 4 * LOST + SLOW)
    now = Progress(20, DT, TICK, 0.02, True, 7, -30.0, SPEED, SPEED)
    member.known["path_position"], member.known["step"] = 0.0, 20
    result = coordinate(
        now,
        member.edges,
        member.signals,
        member.layout,
        member.gains,
        member.state,
    )
    assert result.speed == pytest.approx(-0.2 * SPEED)


def test_a_lost_actuator_counts_at_once_and_until_it_is_well_for_a_time() -> None:
    member = Member(on_lost="widen", recovered_s=2.0)
    member.wait(0.1, 0.0, 0.0, 0.0)
    assert member.own == (NOMINAL, 0)
    member.signals["phase"][0] = LOST_ACTUATOR
    member.update(0.0, 0.0, 0.0)
    assert member.own == (LOST, WIDEN)
    member.signals["phase"][0] = 0
    member.wait(1.9, 0.0, 0.0, 0.0)
    assert member.own == (LOST, WIDEN)
    member.wait(0.2, 0.0, 0.0, 0.0)
    assert member.own == (NOMINAL, 0)


def test_a_degraded_actuator_counts_when_it_is_certain_for_a_second() -> None:
    member = Member(on_degraded="slow")
    member.signals["effectiveness"], member.signals["confidence"] = 1.0, 0.95
    member.signals["effectiveness"][2], member.signals["confidence"][2] = 0.4, 0.5
    member.wait(3.0, 0.0, 0.0, 0.0)
    assert member.own == (NOMINAL, 0)
    member.signals["confidence"][2] = 0.9
    member.wait(0.9, 0.0, 0.0, 0.0)
    assert member.own == (NOMINAL, 0)
    member.wait(0.2, 0.0, 0.0, 0.0)
    assert member.own == (DEGRADED, SLOW)


def test_a_policy_that_the_operator_changes_is_in_force_at_once() -> None:
    member = Member(on_lost="stay")
    member.signals["phase"][0] = LOST_ACTUATOR
    member.wait(0.1, 0.0, 0.0, 0.0)
    assert member.own == (LOST, 0)
    member.gains["on_lost"] = LEAVE
    member.update(0.0, 0.0, 0.0)
    assert member.own == (LOST, LEAVE)


def test_a_neighbour_that_falls_silent_is_entered_by_who_hears_others() -> None:
    member = Member(on_silent="leave")
    member.wait(0.1, 0.0, 0.0, 0.0)
    member.weights[0] = 0.0
    member.update(0.0, 0.0, 0.0)
    entry = member.state["table"][0]
    assert (cause_of(entry), policy_of(entry)) == (SILENT, LEAVE)
    assert member.own == (NOMINAL, 0)


def test_who_hears_nobody_is_cut_off_itself_and_says_nothing_of_the_others() -> None:
    member = Member(on_silent="leave")
    member.wait(0.1, 0.0, 0.0, 0.0)
    member.weights[:] = 0.0
    member.update(0.0, 0.0, 0.0)
    assert member.own == (SILENT, LEAVE)
    assert member.state["table"][[0, 2]].tolist() == [0, 0]


def test_planned_changes_come_on_the_missions_clock() -> None:
    member = Member(changes=[{"at_s": 1.0, "slots": {2: {"ahead_m": -30.0, "right_m": 40.0}}}])
    member.wait(0.98, 0.0, 0.0, 0.0)
    assert member.state["slot"]["rate"].tolist() == [0.0, 0.0, 0.0]
    member.wait(40.0, 0.0, 0.0, 0.0)
    slot = member.update(0.0, 0.0, 0.0).slot
    assert slot == pytest.approx((-30.0, 40.0, 0.0), abs=1e-3)


def test_who_flies_elsewhere_by_itself_has_no_slot() -> None:
    member = Member()
    now = Progress(0, DT, 0.0, 0.0, False, 9, 500.0, SPEED, SPEED)
    result = coordinate(
        now,
        member.edges,
        member.signals,
        member.layout,
        member.gains,
        member.state,
    )
    assert result == Coordination((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    assert member.state["xi"] == 500.0

"""Neighbours' states on the formation link, over real loopback sockets."""

import inspect
import itertools
import math
import threading
from types import FunctionType

import numpy as np
import pytest
from link_bench import NEIGHBOUR, TIMEOUT_STEPS, Rig

from ftc_autopilot.control.config import FormationTrigger
from ftc_autopilot.hot import formation_link
from ftc_autopilot.hot.drops import FORMATION
from ftc_autopilot.hot.state import FORMATION_SIGNER
from gcs.scenario.model import Scenario
from gcs.scenario.sections import FormationLinks
from mavlink_defs.dialect import FTC_SIM_FLAGS_RUNNING
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.runtime.memory import bytes_of


def test_a_step_uses_states_of_the_step_before_even_if_newer_ones_have_arrived(rig: Rig) -> None:
    for step in range(3):
        rig.send_neighbour_state(step, airspeed=40.0 + step)
    rig.state(0)
    assert rig.controllers.edges[0, 0]["message"]["step"] == 0
    rig.state(1)
    assert rig.controllers.edges[0, 0]["message"]["step"] == 0
    rig.state(2)
    assert rig.controllers.edges[0, 0]["message"]["step"] == 1
    assert rig.controllers.edges[0, 0]["message"]["airspeed"] == 41.0


def test_a_silent_neighbour_is_dropped_and_restored_by_and_by(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    for step in range(TIMEOUT_STEPS + 1):
        rig.state(step, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.edges[0, 0]["weight"] == 1.0
    faded, back = TIMEOUT_STEPS + 500, TIMEOUT_STEPS + 1000
    weights = [1.0]
    for step in range(TIMEOUT_STEPS + 1, back + 1):
        if step > faded:
            rig.send_neighbour_state(step - 1)
        rig.state(step, FTC_SIM_FLAGS_RUNNING)
        weights.append(float(rig.controllers.edges[0, 0]["weight"]))
        assert rig.autopilots.own[0]["formation"]["edge_changes"] == (1 if step <= faded else 2)
        assert rig.controllers.edges[0, 0]["edge"] == (step > faded)
    assert weights[500] == pytest.approx(0.0, abs=1e-12)
    assert weights[1000] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.diff(weights)).max() < 0.0021


def test_a_neighbour_state_from_another_address_is_dropped_and_counted(rig: Rig) -> None:
    rig.send_neighbour_state(0, sock=rig.plant)
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.autopilots.own[0]["drops"][FORMATION, -DropReason.STRANGER] == 1
    assert rig.controllers.edges[0, 0]["edge"] == 0
    rig.send_neighbour_state(0)
    rig.state(1, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.edges[0, 0]["edge"] == 1


def test_a_state_of_a_far_later_step_is_not_kept_as_pending(rig: Rig) -> None:
    """As they lie in the socket when the plant, and so the count of steps, was started again."""
    rig.send_neighbour_state(1)
    rig.send_neighbour_state(25_000)
    rig.state(0)
    assert rig.autopilots.own[0]["drops"][FORMATION, -DropReason.OUT_OF_RANGE] == 1
    assert rig.controllers.edges[0, 0]["pending_step"] == 1


def test_states_of_strangers_and_states_that_mean_nothing_are_ignored(rig: Rig) -> None:
    rig.send_neighbour_state(0, system=77)
    rig.send_neighbour_state(0, airspeed=math.nan)
    rig.send_neighbour_state(0, frame=7)
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.edges[0, 0]["weight"] == 0.0


def test_lockstep_uses_its_only_neighbour_again_after_a_lost_state(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.state(1)
    rig.state(2)  # the state of step 1 is lost
    assert rig.controllers.edges[0, 0]["misses"] == 1  # waited for in vain
    rig.send_neighbour_state(2)
    rig.state(3)
    assert rig.controllers.edges[0, 0]["message"]["step"] == 2


def test_the_first_step_waits_for_a_neighbour_that_has_no_processor_yet(rig: Rig) -> None:
    late = threading.Timer(0.3, rig.send_neighbour_state, (0,))
    late.start()
    rig.state(0)
    late.join()
    assert rig.controllers.edges[0, 0]["heard_step"] == 0
    assert rig.controllers.edges[0, 0]["weight"] == 1.0


def test_a_state_of_step_0_is_sent_once_before_that_step(rig: Rig) -> None:
    """A neighbour that is not yet so far would take a second one for it."""
    rig.send_neighbour_state(0)
    rig.state(0)
    assert rig.heard(rig.neighbour) == [codec.MessageId.NEIGHBOUR]
    assert rig.autopilots.own[0]["step_done"]["silent"] == 1
    rig.state(1)
    assert rig.heard(rig.neighbour) == [codec.MessageId.NEIGHBOUR]
    assert rig.autopilots.own[0]["step_done"]["silent"] == 0


def test_a_state_in_the_socket_is_taken_even_if_the_process_is_late(
    rig: Rig,
) -> None:
    """A busy machine may let more time pass between two lines than the wait takes."""
    rig.send_neighbour_state(0)
    rig.state(0)
    for step in (0, 1):
        rig.send_neighbour_state(step)
    seconds = itertools.count()
    plain = {"monotonic_s": lambda: next(seconds), "bytes_of": bytes_of}
    interpreted = inspect.unwrap(formation_link.collect_neighbour_states)
    collect = FunctionType(interpreted.__code__, vars(formation_link) | plain)
    own, signer = rig.autopilots.own[0], rig.autopilots.signer(0, FORMATION_SIGNER)
    collect(rig.formation.fileno(), own, rig.controllers.edges[0], signer, 2, True)
    assert rig.controllers.edges[0, 0]["message"]["step"] == 1
    assert rig.controllers.edges[0, 0]["misses"] == 0


def test_lockstep_stops_waiting_but_hears_a_neighbour_that_is_back(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    for step in range(TIMEOUT_STEPS + 2):
        rig.state(step)
    assert rig.controllers.edges[0, 0]["misses"] == 5  # steps that waited, of more than 250
    assert rig.controllers.edges[0, 0]["edge"] == 0
    rig.send_neighbour_state(TIMEOUT_STEPS + 1)
    rig.state(TIMEOUT_STEPS + 2)
    assert rig.controllers.edges[0, 0]["edge"] == 1


def test_lockstep_does_not_wait_for_a_neighbour_that_sent_nothing(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    for step in range(20):
        rig.state(step, silent=(NEIGHBOUR, 77))
    assert rig.controllers.edges[0, 0]["misses"] == 0
    rig.state(20, silent=(77,))  # sent, but lost
    assert rig.controllers.edges[0, 0]["misses"] == 1
    assert rig.controllers.edges[0, 0]["message"]["step"] == 0


def test_an_autopilot_tells_the_plant_when_it_is_silent(scenario1: Scenario) -> None:
    formation = FormationLinks(trigger=FormationTrigger(longest_silence_s=0.01))
    links = scenario1.links.model_copy(update={"formation": formation})
    rig = Rig(scenario1.model_copy(update={"links": links}))
    reported = []
    for step in range(40):
        rig.send_neighbour_state(step)
        rig.heard(rig.neighbour)
        rig.state(step)
        silent = bool(rig.autopilots.own[0]["step_done"]["silent"])
        messages = rig.heard(rig.neighbour)
        assert len(messages) == (step == 0) + (not silent)  # one before the first step
        reported += [] if silent else [step]
    rig.close()
    assert reported[0] == 1
    assert np.diff(reported).max() <= 10
    assert len(reported) < 20
    assert rig.controllers.uavs[0]["controller"]["neighbour_messages"] == len(reported)

"""The loop keeps each step before its messages go out; a long flight counts right."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from link_bench import LOCKSTEP, UAV, Rig

from ftc_autopilot.hot.formation_link import join_neighbours
from ftc_autopilot.hot.link import LINK_STATE
from ftc_autopilot.hot.restart import with_checkpoint
from gcs.scenario.model import Scenario
from mavlink_defs.framing import codec

ACTUATORS, STEP_DONE = codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE


def rig_with_file(scenario: Scenario, path: Path) -> Rig:
    """A link that restores what is in the file."""
    rig = Rig(scenario)
    same = scenario.autopilot_config(UAV)  # whichever ports the test has
    rig.autopilots, resumes = with_checkpoint(rig.autopilots, same, path)
    join_neighbours(rig.autopilots.edges[0], rig.config.neighbours)
    if resumes:
        rig.autopilots.own["link"]["away"] = 0
    return rig


@pytest.fixture
def first(scenario1: Scenario, tmp_path: Path) -> Iterator[Rig]:
    rig = rig_with_file(scenario1, tmp_path / "checkpoint")
    yield rig
    rig.close()


def test_an_event_that_was_counted_but_not_sent_is_sent_after_the_restart(
    first: Rig, scenario1: Scenario, tmp_path: Path
) -> None:
    """The process died between the two: the plant has seen nothing of step 0."""
    first.send_neighbour_state(0)
    first.state(0)
    assert ACTUATORS in first.heard(first.plant)
    counted = first.controllers.uavs["controller"]["events"].tolist()
    assert counted == [[1, 1, 1, 1]]

    second = rig_with_file(scenario1, tmp_path / "checkpoint")
    try:
        assert second.autopilots.own["link"]["step"] == 0
        assert second.controllers.uavs["controller"]["events"].tolist() == counted
        second.no_more_events()
        second.state(1, applied_usec=-1)
        assert ACTUATORS in second.heard(second.plant)
        assert second.autopilots.own["link"]["repeated"].tolist() == [[1, 1, 1, 1]]
        assert second.controllers.uavs["controller"]["events"].tolist() == counted
        second.state(2, applied_usec=1000)  # the plant has applied it
        assert second.heard(second.plant) == [STEP_DONE]
    finally:
        second.close()


@pytest.mark.parametrize("triggered", [False, True])
def test_after_a_restart_the_next_step_is_as_without_one(
    first: Rig, scenario1: Scenario, tmp_path: Path, triggered: bool
) -> None:
    """Edges have their weights, and neighbours are sent no more than the trigger asks."""
    parameters = first.controllers.uavs[0]["parameters"]
    parameters["formation_triggered"] = triggered
    for name in parameters["formation_trigger"].dtype.names:
        parameters["formation_trigger"][name] = 1e9  # the first message is the only one
    for step in range(20):
        first.send_neighbour_state(step - 1 if step else 0, airspeed=41.0 + 0.01 * step)
        first.state(step)
    assert first.controllers.edges["weight"].any()
    second = rig_with_file(scenario1, tmp_path / "checkpoint")
    try:
        for rig in (first, second):
            rig.send_neighbour_state(19, airspeed=41.2)
            rig.state(20)
        flown = second.controllers.uavs["signals"], first.controllers.uavs["signals"]
        assert flown[0].tobytes() == flown[1].tobytes()
        sent = [rig.controllers.uavs["last_broadcast"] for rig in (second, first)]
        assert sent[0].tobytes() == sent[1].tobytes()
        assert (int(sent[0]["step"][0]) < 20) == triggered
    finally:
        second.close()


def test_a_step_is_never_flown_twice(first: Rig, scenario1: Scenario, tmp_path: Path) -> None:
    first.send_neighbour_state(0)
    for step in range(5):
        first.state(step)
    second = rig_with_file(scenario1, tmp_path / "checkpoint")
    try:
        second.state(4)  # sent again, since the answer was lost
        assert second.heard(second.plant) == [STEP_DONE]
        assert int(second.controllers.uavs["controller"]["steps"][0]) == 5
    finally:
        second.close()


def test_in_lockstep_a_restarted_autopilot_stays_away_for_a_while(first: Rig) -> None:
    first.send_neighbour_state(0)
    first.state(0)
    first.autopilots.own["link"]["away"] = 3
    before = first.controllers.uavs["controller"].copy()
    first.heard(first.plant)
    for step in (1, 2, 3):
        first.state(step)
        assert first.heard(first.plant) == [STEP_DONE]
    assert first.controllers.uavs["controller"].tobytes() == before.tobytes()
    first.state(4)
    assert int(first.controllers.uavs["controller"]["steps"][0]) == 2


def test_after_fifty_thousand_seconds_steps_and_times_are_exact(first: Rig) -> None:
    step = 50_000 * 1000 + 1
    first.send_neighbour_state(0)
    first.state(0)
    first.controllers.uavs["controller"]["held"][:, :3] += (
        1.0  # far from any demand: events of the surfaces
    )
    first.state(step, LOCKSTEP, applied_usec=0)
    first.heard(first.plant)
    state = first.controllers.uavs[0]["controller"]
    assert int(first.autopilots.own["link"]["step"][0]) == step
    event = int(np.argmax(state["last_event"]))
    assert int(state["last_event"][event]) == step
    assert int(first.controllers.uavs["actuators"]["time_usec"][0]) == 50_000_001_000
    assert int(first.controllers.uavs["own_state"]["step"][0]) == step
    assert LINK_STATE["step"].itemsize == 8


def test_what_a_member_knows_of_its_formation_stays(
    first: Rig, scenario1: Scenario, tmp_path: Path
) -> None:
    state = first.controllers.uavs[0]["formation"]
    state["table"][1], state["commanded"], state["virtual"] = 27, (-60.0, 5.0, 10.0), 800.0
    first.send_neighbour_state(0)
    first.state(0)
    second = rig_with_file(scenario1, tmp_path / "checkpoint")
    try:
        taken = second.controllers.uavs[0]["formation"]
        assert (taken["table"][1], taken["virtual"]) == (27, 800.0)
        assert taken["commanded"].tolist() == [-60.0, 5.0, 10.0]
    finally:
        second.close()

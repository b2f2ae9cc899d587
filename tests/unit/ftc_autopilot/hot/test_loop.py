"""The compiled loop with several autopilots: each is served, and none hears of the others."""

import time
from collections.abc import Iterator

import numpy as np
import pytest
from link_bench import Rig

from ftc_autopilot.hot.loop import Loops, new_loops, run
from ftc_autopilot.hot.state import new_autopilots
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.codec import MessageId
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.hot_link import ReturnReason

ANSWERS = [MessageId.ACTUATORS, MessageId.STEP_DONE]


@pytest.fixture
def pair(scenario1: Scenario) -> Iterator[tuple[Rig, Rig]]:
    rigs = Rig(scenario1), Rig(scenario1)
    together = new_autopilots([rig.config for rig in rigs])
    for i, rig in enumerate(rigs):
        rig.fly_by(together.of(i))
    rigs[0].together = together
    yield rigs
    for rig in rigs:
        rig.close()


def loops_of(*rigs: Rig, until_s: float | None = None, until_step: int = 2**62) -> Loops:
    """Return the rigs' autopilots in one process, which return at a time or after a step."""
    fds = [(rig.own.fileno(), rig.formation.fileno(), rig.gcs.fileno()) for rig in rigs]
    both = new_loops(rigs[0].together, fds, range(len(rigs)))
    both.state["until_s"] = time.monotonic() if until_s is None else until_s
    both.state["until_step"] = until_step
    return both


def test_each_answers_its_own_states(pair: tuple[Rig, Rig]) -> None:
    for rig in pair:
        rig.send_neighbour_state(0)
        rig.send_state(0)
    both = loops_of(*pair)
    run(both)
    assert both.state["outcome"].tolist() == [ReturnReason.TICK] * 2
    assert [rig.heard(rig.plant) for rig in pair] == [ANSWERS, ANSWERS]
    pair[1].send_neighbour_state(1)
    pair[1].send_state(1)
    run(both)
    assert [rig.autopilots.own[0]["link"]["step"] for rig in pair] == [0, 1]
    assert [rig.heard(rig.plant)[-1:] for rig in pair] == [[], [MessageId.STEP_DONE]]


def test_only_those_that_need_python_say_so(pair: tuple[Rig, Rig]) -> None:
    for rig in pair:
        rig.send_neighbour_state(0)
        rig.send_state(0)
    run(loops_of(*pair))
    later = time.monotonic() + 60.0
    heartbeat = dialect.MAVLink_heartbeat_message(0, 0, 0, 0, 0, 3)
    pair[1].plant.sendto(FramePacker(2, 25).pack(heartbeat), pair[1].own.getsockname())
    both = loops_of(*pair, until_s=later)
    run(both)
    assert both.state["outcome"].tolist() == [ReturnReason.NONE, ReturnReason.SERVICE]
    pair[0].send_neighbour_state(1)
    pair[0].send_state(1)
    both = loops_of(*pair, until_s=later, until_step=1)
    run(both)
    assert both.state["outcome"].tolist() == [ReturnReason.TICK, ReturnReason.NONE]


@pytest.mark.parametrize("i", [0, 1])
def test_a_datagram_of_a_ground_station_ends_the_wait_for_its_vehicle(
    pair: tuple[Rig, Rig], i: int
) -> None:
    for rig in pair:
        rig.send_neighbour_state(0)
        rig.send_state(0)
    run(loops_of(*pair))
    both = loops_of(*pair, until_s=time.monotonic() + 60.0)
    pair[i].neighbour.sendto(b"anything", pair[i].gcs.getsockname())
    run(both)
    expected = [ReturnReason.NONE, ReturnReason.NONE]
    expected[i] = ReturnReason.TICK
    assert both.state["outcome"].tolist() == expected


def test_the_first_time_that_comes_ends_the_sleep(pair: tuple[Rig, Rig]) -> None:
    both = loops_of(*pair)  # neither has heard the plant
    both.state["until_s"] += np.array([60.0, 0.01])
    run(both)
    assert both.state["outcome"].tolist() == [ReturnReason.NONE, ReturnReason.TICK]

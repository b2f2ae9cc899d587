"""Word of places gets around: along every chain of links, never in circles, and not for ever."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ftc_autopilot.guidance.formation import LAYOUT
from ftc_autopilot.guidance.places import (
    FORGOTTEN_S,
    MAX_RELAYED,
    NO_PLACE,
    PLACE,
    REPEAT_S,
    choose_relayed,
    is_known,
    note_relayed,
    place_now,
    relay,
    take_in,
)
from ftc_autopilot.guidance.reach import most_links
from mavlink_defs.framing.codec import NEIGHBOUR

DT = 0.02  # guidance updates in each step here


class Member:
    """Flies a circle, and tells its neighbours."""

    def __init__(self, index: int, ids: list[int], neighbours: list[int]) -> None:
        self.index, self.neighbours = index, neighbours
        self.layout: np.void = np.zeros(1, LAYOUT)[0]
        self.layout["count"], self.layout["own"] = len(ids), index
        self.layout["ids"][: len(ids)] = ids
        self.layout["neighbours"] = -1
        self.layout["neighbours"][: len(neighbours)] = neighbours
        self.state: np.void = np.zeros(
            1,
            [
                ("places", PLACE, (64,)),
                ("last_relayed", PLACE, (64,)),
                ("relayed", "i8", (MAX_RELAYED,)),
                ("relay_error", "f8"),
            ],
        )[0]
        self.state["places"]["step"] = self.state["last_relayed"]["step"] = NO_PLACE

    def position(self, step: int) -> np.ndarray:
        angle = 0.1 * step * DT + self.index
        return np.array([400.0 * math.cos(angle), 400.0 * math.sin(angle), -100.0])

    def tell(self, step: int) -> np.ndarray:
        state, message = self.state, np.zeros(1, NEIGHBOUR)
        choose_relayed(
            step, DT, self.layout, state["places"], state["last_relayed"], state["relayed"]
        )
        message["step"], message["path_id"] = step, 7
        message["position"] = self.position(step)
        message["ground_velocity"] = (self.position(step + 1) - self.position(step)) / DT
        relay(state["relayed"], self.layout, state["places"], message[0])
        note_relayed(message[0], self.layout, state)
        return message

    def hear(self, message: np.ndarray, sender: int) -> None:
        take_in(message[0], sender, self.layout, self.state["places"])


@st.composite
def graphs(draw: st.DrawFn) -> list[list[int]]:
    """Neighbours of each of up to twelve members that are all joined."""
    count = draw(st.integers(2, 12))
    edges = {(draw(st.integers(0, b - 1)), b) for b in range(1, count)}
    more = st.tuples(st.integers(0, count - 1), st.integers(0, count - 1))
    edges |= {(min(pair), max(pair)) for pair in draw(st.lists(more, max_size=4))}
    joined = {pair for pair in edges if pair[0] != pair[1]}
    return [[a + b - m for a, b in sorted(joined) if m in (a, b)] for m in range(count)]


def fleet(graph: list[list[int]]) -> list[Member]:
    ids = [3 * m + 1 for m in range(len(graph))]
    return [Member(m, ids, neighbours) for m, neighbours in enumerate(graph)]


def fly(members: list[Member], first: int, steps: int, silent: frozenset[int] = frozenset()) -> int:
    """Let members tell and hear, each message one step late; return the next step."""
    for step in range(first, first + steps):
        reported = [member.tell(step) for member in members]
        for member in members:
            for sender in member.neighbours:
                if not {sender, member.index} & silent:
                    member.hear(reported[sender], sender)
    return first + steps


def links(graph: list[list[int]], start: int) -> list[int]:
    found, border = {start: 0}, [start]
    for near in border:
        new = [other for other in graph[near] if other not in found]
        found |= dict.fromkeys(new, found[near] + 1)
        border += new
    return [found[m] for m in range(len(graph))]


@settings(max_examples=settings().max_examples // 4)
@given(graphs())
def test_everyone_knows_where_everyone_is(graph: list[list[int]]) -> None:
    """The age of a place grows by what `most_links` counts on for each link, at most."""
    members = fleet(graph)
    step = fly(members, 0, round(4.0 / DT))
    cycle = math.ceil(max(len(graph) - 2, 1) / MAX_RELAYED)
    for member in members:
        for other, far in enumerate(links(graph, member.index)):
            if other == member.index:
                assert member.state["places"][other]["step"] == NO_PLACE
                continue
            place = member.state["places"][other]
            age = step - 1 - int(place["step"])
            assert age <= (far - 1) * (cycle + 2), (member.index, other)
            off = np.array(place_now(place, (step - 1) * DT, DT)) - members[other].position(
                step - 1
            )
            assert np.linalg.norm(off) <= 0.1 + 4.5 * (age * DT) ** 2


@settings(max_examples=settings().max_examples // 4)
@given(graphs(), st.data())
def test_who_is_silent_is_forgotten_by_all(graph: list[list[int]], data: st.DataObject) -> None:
    """Nobody's echo keeps a place alive."""
    members = fleet(graph)
    gone = data.draw(st.integers(0, len(graph) - 1))
    step = fly(members, 0, round(2.0 / DT))
    assert all(is_known(m.state["places"][gone], step, DT) for m in members if m.index != gone)
    step = fly(members, step, round(FORGOTTEN_S / DT) + 1, frozenset({gone}))
    assert not any(is_known(m.state["places"][gone], step, DT) for m in members)


def test_who_has_one_neighbour_relays_nobody() -> None:
    members = fleet([[1], [0, 2], [1]])
    step = fly(members, 0, 10)
    assert [np.any(m.tell(step)["relayed"] != 0) for m in members] == [False, True, False]


def test_a_place_is_not_taken_for_newer_than_its_message() -> None:
    members = fleet([[1], [0, 2], [1]])
    message = members[1].tell(5)
    message["relayed"], message["relayed_step"] = [7, 200], [6, 5]
    members[0].hear(message, 1)
    assert members[0].state["places"]["step"][:3].tolist() == [NO_PLACE, 5, NO_PLACE]


@pytest.mark.parametrize(("step", "due"), [(0, True), (1, False), (round(REPEAT_S / DT), True)])
def test_a_place_is_due_when_it_is_new_wrong_or_old(step: int, due: bool) -> None:
    member = fleet([[1], [0, 2], [1]])[1]
    state = member.state
    for place in (state["places"][0], *([state["last_relayed"][0]] if step else [])):
        place["step"], place["velocity"] = 0, (40.0, 0.0, 0.0)
    state["places"][0]["step"] = step
    state["places"][0]["position"] = (40.0 * step * DT, 0.0, 0.0)
    chosen = (DT, member.layout, state["places"], state["last_relayed"], state["relayed"])
    assert math.isinf(choose_relayed(step, *chosen)) is due
    state["places"][0]["position"] += (0.0, 0.75, 0.0)
    assert choose_relayed(step, *chosen) == pytest.approx(math.inf if due else 0.75)


@pytest.mark.parametrize(
    ("members", "silence_s", "most"), [(2, None, 250), (10, None, 63), (64, None, 9), (10, 0.2, 5)]
)
def test_a_place_gets_around_so_many_links(
    members: int, silence_s: float | None, most: int
) -> None:
    assert most_links(members, 0.02, silence_s) == most

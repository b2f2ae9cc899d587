"""The members of a formation come to know the same of each other, and derive the same from it."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.formation import MAX_MEMBERS
from ftc_autopilot.guidance.members import (
    LEAVE,
    LOST,
    SILENT,
    STAY,
    cause_of,
    enter,
    merge,
    occupants,
    policy_of,
    state_of,
)

LEFT_BY_LOSS = 4 * LOST + LEAVE
SILENT_AND_LEFT = 4 * SILENT + LEAVE


def new_table() -> np.ndarray:
    return np.zeros(MAX_MEMBERS, np.uint8)


def reported(table: np.ndarray, by: np.ndarray, own: int, heard: tuple[int, ...] = ()) -> bool:
    hears = np.zeros(MAX_MEMBERS, np.uint8)
    hears[list(heard)] = 1
    return merge(table, by, own, hears, MAX_MEMBERS)


def test_a_state_is_a_cause_and_a_policy() -> None:
    table = new_table()
    assert enter(table, 3, LEFT_BY_LOSS)
    assert (cause_of(table[3]), policy_of(table[3])) == (LOST, LEAVE)
    assert not enter(table, 3, LEFT_BY_LOSS)
    assert (cause_of(table[2]), policy_of(table[2])) == (0, STAY)


def test_news_spreads_along_a_chain_and_old_news_does_not() -> None:
    first, second, third = new_table(), new_table(), new_table()
    old = new_table()
    enter(first, 0, LEFT_BY_LOSS)
    assert reported(second, first, own=1)
    assert reported(third, second, own=2)
    assert state_of(third[0]) == LEFT_BY_LOSS
    assert not reported(third, old, own=2)
    assert not reported(third, second, own=2)
    enter(first, 0, 0)
    assert reported(second, first, own=1)
    assert state_of(second[0]) == 0


def test_counts_of_changes_are_compared_modulo() -> None:
    """After more changes than the counter has numbers, news is still news."""
    first, second = new_table(), new_table()
    for change in range(40):
        enter(first, 0, LEFT_BY_LOSS if change % 2 == 0 else 0)
        assert reported(second, first, own=1)
        assert second[0] == first[0]


def test_who_is_back_overrules_what_others_said_of_it() -> None:
    lost, keeper = new_table(), new_table()
    enter(keeper, 0, SILENT_AND_LEFT)
    assert reported(lost, keeper, own=0)
    assert state_of(lost[0]) == 0
    assert reported(keeper, lost, own=1)
    assert state_of(keeper[0]) == 0
    assert not reported(lost, keeper, own=0)


def test_silence_of_a_member_is_not_believed_by_who_hears_it() -> None:
    hearing, other = new_table(), new_table()
    enter(other, 0, SILENT_AND_LEFT)
    assert not reported(hearing, other, own=1, heard=(0, 2))
    assert reported(hearing, other, own=1, heard=(2,))


@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_all_agree_in_the_end_and_each_as_itself_says(seed: int, n: int) -> None:
    """Whatever states and tables they had, in whatever order they hear each other."""
    random = np.random.default_rng(seed)
    tables = [new_table() for _ in range(n)]
    for table in tables:
        table[:n] = random.integers(0, 256, n)
    own = [state_of(table[m]) for m, table in enumerate(tables)]
    links = [(m, m - 1) for m in range(1, n)] + [(m - 1, m) for m in range(1, n)]
    for _ in range(6 * n):
        for k in random.permutation(len(links)):
            to, by = links[k]
            reported(tables[to], tables[by], own=to)
    # each entry comes from its owner as soon as its counter is not half a turn away
    for m, table in enumerate(tables):
        assert state_of(table[m]) == own[m]
    for _ in range(2):
        for m, table in enumerate(tables):
            enter(table, m, own[m] ^ 1)
            enter(table, m, own[m])
        for _ in range(6 * n):
            for to, by in links:
                reported(tables[to], tables[by], own=to)
    for table in tables:
        assert [state_of(entry) for entry in table[:n]] == own


def slots_of(*places: tuple[float, float]) -> np.ndarray:
    slots = np.zeros((MAX_MEMBERS, 3))
    slots[: len(places), :2] = places
    return slots


def taken(slots: np.ndarray, count: int, *left: int) -> list[int]:
    table, slot_of = new_table(), np.zeros(MAX_MEMBERS, np.int64)
    for m in left:
        enter(table, m, LEFT_BY_LOSS)
    occupants(slots, table, count, slot_of)
    return slot_of[:count].tolist()


V5 = slots_of((0.0, 0.0), (-20.0, -20.0), (-20.0, 20.0), (-40.0, -40.0), (-40.0, 40.0))
COLUMN = slots_of((0.0, 0.0), (-25.0, 0.0), (-50.0, 0.0), (-75.0, 0.0))


@pytest.mark.parametrize(
    ("slots", "count", "left", "expected"),
    [
        (V5, 5, (), [0, 1, 2, 3, 4]),
        (V5, 5, (1,), [0, 1, 2, 1, 4]),  # the outer one on the left moves in
        (V5, 5, (3,), [0, 1, 2, 3, 4]),  # nobody is further out
        (V5, 3, (1,), [0, 1, 2]),  # to the other side closes no gap
        (V5, 5, (0,), [0, 0, 2, 1, 4]),  # the lower id leads, and is followed up
        (COLUMN, 4, (1,), [0, 1, 1, 2]),
        (COLUMN, 4, (0, 1), [0, 1, 0, 1]),
    ],
)
def test_gaps_are_closed_from_the_inside_out(
    slots: np.ndarray, count: int, left: tuple[int, ...], expected: list[int]
) -> None:
    assert taken(slots, count, *left) == expected


@given(
    st.lists(
        st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=2, max_size=12, unique=True
    ),
    st.data(),
)
def test_members_have_slots_of_their_own_and_none_moves_outwards(
    places: list[tuple[int, int]], data: st.DataObject
) -> None:
    slots = slots_of(*[(20.0 * a, 20.0 * b) for a, b in places])
    n = len(places)
    left = data.draw(st.sets(st.integers(0, n - 1), max_size=n))
    slot_of = taken(slots, n, *left)
    present = [m for m in range(n) if m not in left]
    assert len({slot_of[m] for m in present}) == len(present)
    for m in present:
        assert np.linalg.norm(slots[slot_of[m]]) <= np.linalg.norm(slots[m])
    free = set(range(n)) - {slot_of[m] for m in present}
    for gap, m in ((gap, m) for gap in free for m in present):
        assert np.linalg.norm(slots[slot_of[m]]) <= np.linalg.norm(slots[gap]) + 1.0
    for m in left:
        assert slot_of[m] == m
    assert all(
        math.dist(slots[slot_of[a]], slots[slot_of[b]]) >= 20.0 for a, b in combinations(present, 2)
    )

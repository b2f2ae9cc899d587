"""Formations whose members could meet without knowing of each other are refused."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.reach import reach_problems

LINE: dict[int, Any] = {k: {"ahead_m": -25.0 * k} for k in range(1, 6)}
CHAIN = [(1, 2), (2, 3), (3, 4), (4, 5)]


def problems(edges: list[tuple[int, int]], most: int, **keys: Any) -> list[str]:
    formation = Formation.model_validate({"slots": LINE} | keys)
    return [text for _, text in reach_problems(formation, edges, most)]


def test_who_is_joined_by_few_links_may_fly_as_close_as_they_like() -> None:
    assert problems(CHAIN, 4) == []


def test_the_refusal_names_the_pair_the_reason_and_what_to_do() -> None:
    assert problems(CHAIN, 3) == [
        "UAVs 1 and 5 fly within 0 m of each other across the path, and neither knows in time "
        "where the other is: 4 links are between them, and a place is relayed over 3 at most; "
        "give them an edge in network.edges, or slots at least 30 m apart across the path"
    ]
    apart = problems([(1, 2), (3, 4), (4, 5)], 9)
    assert [text[:12] for text in apart] == [f"UAVs {a} and {b}" for a in (1, 2) for b in (3, 4, 5)]
    assert all("no chain of links joins them" in text for text in apart)


def test_two_groups_may_fly_apart_but_not_change_over_to_each_other() -> None:
    groups = {1: {}, 2: {"ahead_m": -25.0}, 3: {"right_m": 60.0}, 4: {"up_m": 60.0}}
    edges = [(1, 2)]
    assert problems(edges, 9, slots=groups) == []
    across = [{"at_s": 5.0, "slots": {3: {"right_m": -60.0}}}]
    (text, other) = problems(edges, 9, slots=groups, changes=across)
    assert text.startswith("UAVs 1 and 3 fly within 0 m")
    assert other.startswith("UAVs 2 and 3 fly within 0 m")
    (text, *_) = problems(edges, 9, slots=groups, on_lost="leave")  # 1 and 2 leave upwards
    assert text.startswith("UAVs 1 and 4 fly within 10 m")


def test_who_asks_for_no_distance_is_not_refused() -> None:
    assert problems([], 9, separation_m=0.0) == []


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), max_size=8), st.integers(1, 5))
def test_each_pair_is_either_joined_by_so_few_links_or_refused(
    edges: list[tuple[int, int]], most: int
) -> None:
    refused = {tuple(map(int, (text[5], text[11]))) for text in problems(edges, most)}
    reached = {m: {m} for m in LINE}
    for _ in range(most):
        border = {m: set(near) for m, near in reached.items()}
        for a, b in edges:
            for m, near in border.items():
                reached[m] |= ({b} if a in near else set()) | ({a} if b in near else set())
    expected = {(a, b) for a in LINE for b in LINE if a < b and b not in reached[a]}
    assert refused == expected


@pytest.mark.parametrize("slots", [{1: {}}, {1: {}, 2: {"right_m": 25.0}}])
def test_small_formations(slots: dict[int, Any]) -> None:
    assert len(problems([], 9, slots=slots)) == len(slots) - 1
    assert problems([(1, 2)], 9, slots=slots) == []

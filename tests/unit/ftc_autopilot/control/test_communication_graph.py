import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.communication_graph import (
    adjacency,
    check_lemma1,
    formation_problems,
    laplacian,
)

FROM_ANY = "from any UAV with leader access"
NOT_DEFINITE = "so L + H is not positive definite (Lemma 1)"


def test_matrices_of_the_papers_graph() -> None:
    A = adjacency([1, 2, 3], [(1, 2, 1.0), (1, 3, 1.0)])
    assert A.tolist() == [[0, 1, 1], [1, 0, 0], [1, 0, 0]]
    assert laplacian(A).tolist() == [[2, -1, -1], [-1, 1, 0], [-1, 0, 1]]
    assert check_lemma1([1, 2, 3], A, np.array([1.0, 0.0, 0.0])) is None


@pytest.mark.parametrize(
    ("edges", "access", "problems"),
    [
        ([(1, 2, 1.0), (2, 3, 1.0), (3, 4, 1.0)], {4: 0.5}, []),
        ([(1, 2, 1.0)], {1: 1.0, 3: 1.0, 4: 2.0}, []),
        ([], {1: 1.0, 2: 1.0, 3: 1.0, 4: 1.0}, []),
        (
            [(1, 3, 1.0), (2, 4, 1.0)],
            {1: 1.0},
            [((), f"UAVs 2 and 4 cannot be reached {FROM_ANY}, {NOT_DEFINITE}")],
        ),
        (
            [(1, 3, 1.0), (1, 4, 1.0)],
            {1: 1.0},
            [((), f"UAV 2 cannot be reached {FROM_ANY}, {NOT_DEFINITE}")],
        ),
        ([(1, 2, 1.0)], {}, [((), f"no UAV has leader access, {NOT_DEFINITE}")]),
        (
            [(1, 7, 1.0), (2, 2, 1.0), (3, 4, 1.0), (4, 3, -1.0), (1, 2, np.nan)],
            {9: 1.0, 1: 0.0},
            [
                (("leader_access", 9), "expected one of the UAVs 1, 2, 3, 4, got 9"),
                (("leader_access", 1), "expected a finite number > 0, got 0.0"),
                (("edges", 0, "between", 1), "expected one of the UAVs 1, 2, 3, 4, got 7"),
                (("edges", 1, "between"), "expected two UAVs, got 2 twice"),
                (("edges", 3, "between"), "UAVs 4 and 3 are joined already by edges[2]"),
                (("edges", 3, "weight"), "expected a finite number > 0, got -1.0"),
                (("edges", 4, "weight"), "expected a finite number > 0, got nan"),
            ],
        ),
    ],
)
def test_problems_of_a_graph(
    edges: list[tuple[int, int, float]], access: dict[int, float], problems: list[object]
) -> None:
    assert formation_problems([1, 2, 3, 4], edges, access) == problems


def test_weights_too_unequal_for_double_precision_are_refused() -> None:
    problems = formation_problems([1, 2, 3], [(1, 2, 1e-15), (1, 3, 1e15)], {1: 1.0})
    assert [loc for loc, _ in problems] == [()]
    assert problems[0][1].startswith("L + H is not positive definite (Lemma 1): its eigenvalues")


@given(
    edges=st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)).filter(lambda e: e[0] < e[1])),
    access=st.sets(st.integers(0, 5)),
    weight=st.floats(0.1, 10.0),
)
def test_reachability_is_positive_definiteness(
    edges: set[tuple[int, int]], access: set[int], weight: float
) -> None:
    ids = list(range(6))
    A = adjacency(ids, [(i, j, weight) for i, j in edges])
    h = np.array([float(i in access) for i in ids])
    smallest = np.linalg.eigvalsh(laplacian(A) + np.diag(h))[0]
    assert (check_lemma1(ids, A, h) is None) == (smallest > 1e-9)

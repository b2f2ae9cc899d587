"""The communication graph, section II-D of the paper: undirected, weighted, with leader access.

Lemma 1: the formation tracks its reference only if L + H is positive definite, that is, if
every UAV is joined by some path to one that has leader access.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from mavlink_defs.config.models import Loc

Edge = tuple[int, int, float]
"""Two UAV ids and the weight a_ij = a_ji."""


def adjacency(ids: Sequence[int], edges: Sequence[Edge]) -> np.ndarray:
    """Return the symmetric matrix A = [a_ij], rows and columns in the order of `ids`."""
    A = np.zeros((len(ids), len(ids)))
    for first, second, weight in edges:
        i, j = ids.index(first), ids.index(second)
        A[i, j] = A[j, i] = weight
    return A


def laplacian(A: np.ndarray) -> np.ndarray:
    """Return L = D - A of an adjacency matrix, shape (n, n)."""
    L: np.ndarray = np.diag(A.sum(axis=1)) - A
    return L


def check_lemma1(ids: Sequence[int], A: np.ndarray, h: np.ndarray) -> str | None:
    """Return why L + H is not positive definite; None if it is.

    Args:
        ids: UAV ids in the order of the matrix.
        A: Adjacency matrix, symmetric, weights >= 0, shape (n, n).
        h: Leader access h_i >= 0, the diagonal of H, shape (n,).
    """
    reached = h > 0.0
    if not reached.any():
        return "no UAV has leader access, so L + H is not positive definite (Lemma 1)"
    for _ in ids:
        reached = reached | (A[reached] > 0.0).any(axis=0)
    if not reached.all():
        cut_off = [str(uav) for uav, ok in zip(ids, reached, strict=True) if not ok]
        who = f"UAV {cut_off[0]}"
        if len(cut_off) > 1:
            who = f"UAVs {', '.join(cut_off[:-1])} and {cut_off[-1]}"
        return (
            f"{who} cannot be reached from any UAV with leader access, "
            "so L + H is not positive definite (Lemma 1)"
        )
    eigenvalues = np.linalg.eigvalsh(laplacian(A) + np.diag(h))
    if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:  # weights too unequal for double precision
        return (
            "L + H is not positive definite (Lemma 1): "
            f"its eigenvalues reach from {eigenvalues[0]:g} to {eigenvalues[-1]:g}"
        )
    return None


def formation_problems(
    ids: Sequence[int], edges: Sequence[Edge], leader_access: Mapping[int, float]
) -> list[tuple[Loc, str]]:
    """Find everything wrong with a graph.

    Args:
        ids: All UAVs.
        edges: The edges; each holds for both directions.
        leader_access: Weight h_i of each UAV that knows the reference.

    Returns:
        Places below a section {leader_access, edges: [{between, weight}]}, and problems.
    """
    known = f"expected one of the UAVs {', '.join(map(str, ids))}"
    problems: list[tuple[Loc, str]] = [
        (("leader_access", uav), f"{known}, got {uav}") for uav in leader_access if uav not in ids
    ]
    problems += [
        (("leader_access", uav), f"expected a finite number > 0, got {weight!r}")
        for uav, weight in leader_access.items()
        if not _is_weight(weight)
    ]
    pairs: dict[frozenset[int], int] = {}
    for k, (*ends, weight) in enumerate(edges):
        problems += [
            (("edges", k, "between", end), f"{known}, got {uav}")
            for end, uav in enumerate(ends)
            if uav not in ids
        ]
        first = pairs.setdefault(frozenset(ends), k)
        if ends[0] == ends[1]:
            problems.append((("edges", k, "between"), f"expected two UAVs, got {ends[0]} twice"))
        elif first != k:
            text = f"UAVs {ends[0]} and {ends[1]} are joined already by edges[{first}]"
            problems.append((("edges", k, "between"), text))
        if not _is_weight(weight):
            text = f"expected a finite number > 0, got {weight!r}"
            problems.append((("edges", k, "weight"), text))
    if not problems:
        h = np.array([leader_access.get(uav, 0.0) for uav in ids])
        reason = check_lemma1(ids, adjacency(ids, edges), h)
        problems += [((), reason)] if reason else []
    return problems


def _is_weight(weight: float) -> bool:
    return bool(np.isfinite(weight) and weight > 0.0)

"""Equalities along a flight, compared to rounding."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ROUNDING = 1e-11
"""Largest deviation of the two sides of an equality, as a share of the summands' magnitudes.

A side is made of at most about 200 operations, each with a relative error of 2⁻⁵³, and the worst
conditioned of them, R2⁻¹, multiplies errors by less than 60 up to ±89° of pitch: 200 · 60 · 2⁻⁵³
= 1.3e-12. There is no discretisation error: everything compared belongs to one step, and what
advances from one step to the next is one explicit Euler step in the law as well.
"""

_TINY = 1e-300  # far from its centres the network's basis underflows


@dataclass(frozen=True)
class Equality:
    """An equality evaluated along a flight.

    Attributes:
        equation: Its number in the paper.
        quantity: What is compared.
        steps: Steps at which it was compared.
        violated: Those at which the sides differ by more than `ROUNDING`.
        largest: Largest deviation as a share of the summands' magnitudes; None if there is no
            step, or if it is not finite.
        at_s: Time of the largest deviation [s]; None without one.
    """

    equation: str
    quantity: str
    steps: int
    violated: int
    largest: float | None
    at_s: float | None


def compare(
    equation: str,
    quantity: str,
    left: np.ndarray,
    *terms: np.ndarray,
    where: np.ndarray,
    time_s: np.ndarray,
    cancelled: Sequence[np.ndarray] = (),
) -> Equality:
    """Compare a quantity with a sum at the steps of a mask.

    Args:
        equation: Its number in the paper.
        quantity: What is compared.
        left: Shape (n,) or (n, components).
        terms: The summands of the right side, each of the shape of `left`.
        where: Mask, (n,).
        time_s: Shape (n,).
        cancelled: Further magnitudes, (n,) or (n, components): summands that cancel within a
            term or within `left`, and whose rounding remains.
    """
    at = np.flatnonzero(where)
    if not len(at):
        return Equality(equation, quantity, 0, 0, None, None)
    with np.errstate(all="ignore"):  # a departed flight may overflow
        size = _magnitude(*(term[at] for term in (*terms, *cancelled)))
        share = _magnitude((left - np.sum(terms, axis=0))[at]) / (size + _TINY)
    share = np.where(np.isnan(share), np.inf, share)
    worst = int(share.argmax())
    return Equality(
        equation=equation,
        quantity=quantity,
        steps=len(at),
        violated=int(np.count_nonzero(share > ROUNDING)),
        largest=float(share[worst]) if np.isfinite(share[worst]) else None,
        at_s=float(time_s[at[worst]]),
    )


def _magnitude(*terms: np.ndarray) -> np.ndarray:
    """Sum of the terms' magnitudes, of a vector its norm; (n,)."""
    sizes = [np.abs(t) if t.ndim == 1 else np.linalg.norm(t, axis=1) for t in terms]
    total: np.ndarray = np.sum(sizes, axis=0)
    return total

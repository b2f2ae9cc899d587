"""Stopping a campaign once a condition is decided, at a stated error however often it is checked.

The evidence for "p < p0" after n flights with k events is the likelihood of the data averaged over
p < p0, by Jeffreys' prior cut off there, divided by their likelihood at p0 (a mixture as of Robbins
1970). Wherever p is at least p0 this is a nonnegative supermartingale that begins at 1, so by
Ville's inequality it ever reaches 1/α with a probability of at most α: it may be checked after each
flight, and stop when it does.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq
from scipy.special import betainc, betaincc, betaln

from ftc_lab.campaigns.conditions import Condition, happened
from ftc_lab.campaigns.statistics import Estimate

_PRIOR = 0.5  # both parameters of Jeffreys' beta distribution


@dataclass(frozen=True)
class Verdict:
    """The state of a condition for one variant.

    Attributes:
        count: Flights with the event.
        flights: Flights that count.
        decided: Shown, refuted (the contrary is shown), or open as yet.
    """

    count: int
    flights: int
    decided: Literal["shown", "refuted", "open"]


def evidence(count: int, flights: int, bound: float, relation: Literal["<", ">"]) -> float:
    """Return the logarithm of the evidence that a probability is below (above) a bound.

    Args:
        count: Flights with the event.
        flights: All flights so far, in an order that does not depend on their outcomes.
        bound: The bound p0, in (0, 1).
        relation: Which of the two is to be shown.
    """
    inside = betainc if relation == "<" else betaincc
    a, b = _PRIOR + count, _PRIOR + flights - count
    with np.errstate(divide="ignore"):  # no evidence at all
        prior = betaln(_PRIOR, _PRIOR) + np.log(inside(_PRIOR, _PRIOR, bound))
        mixture = betaln(a, b) + np.log(inside(a, b, bound))
    return float(mixture - prior - _log_likelihood(count, flights, bound))


def judge(condition: Condition, outcome: np.ndarray) -> Verdict:
    """Judge a condition by the flights of one variant.

    Args:
        condition: The condition; each of "shown" and "refuted" is wrong with at most the
            probability `condition.error`, in a whole campaign.
        outcome: Of the leading flights, as `leading` gives them, shape (flights,).
    """
    count, flights = int(happened(condition.event, outcome).sum()), len(outcome)
    enough = -math.log(condition.error)
    contrary: Literal["<", ">"] = ">" if condition.relation == "<" else "<"
    if evidence(count, flights, condition.probability, condition.relation) >= enough:
        return Verdict(count, flights, "shown")
    if evidence(count, flights, condition.probability, contrary) >= enough:
        return Verdict(count, flights, "refuted")
    return Verdict(count, flights, "open")


def leading(draw: np.ndarray) -> np.ndarray:
    """Return which flights come before the first gap, as indices in the order of draws.

    A lost flight is short and ends before its neighbours: whatever has finished at one moment is
    no fair sample. The draws 0, 1, ... up to the first that is missing are.

    Args:
        draw: Numbers of the draws that were flown, each once, in any order.
    """
    order = np.argsort(draw)
    gaps = np.flatnonzero(draw[order] != np.arange(len(draw)))
    return order[: gaps[0]] if len(gaps) else order


def anytime_proportion(count: int, flights: int, level: float = 0.95) -> Estimate:
    """Estimate a probability after stopping that depended on the data (confidence sequence).

    All intervals of a campaign, one after each flight, hold together with probability `level`.
    """
    if flights == 0:
        return Estimate(math.nan, 0.0, 1.0)
    mixture = betaln(_PRIOR + count, _PRIOR + flights - count) - betaln(_PRIOR, _PRIOR)
    enough = -math.log1p(-level)

    def excess(p: float) -> float:
        return float(mixture - _log_likelihood(count, flights, p) - enough)

    value = count / flights
    low = brentq(excess, 1e-300, value) if count else 0.0
    high = brentq(excess, value, 1.0 - 1e-16) if count < flights else 1.0
    return Estimate(value, float(low), float(high))


def _log_likelihood(count: int, flights: int, p: float) -> float:
    return (count * math.log(p) if count else 0.0) + (
        (flights - count) * math.log1p(-p) if flights > count else 0.0
    )

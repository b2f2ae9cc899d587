"""Which simpler law does better: the one rule behind bold figures in tables of several laws.

A figure enters as a cost: smaller is better, infinite where a flight was lost, NaN where there is
nothing to compare. Who compares sees to it that the flights are the same but for law and trigger.
"""

import math
from collections.abc import Iterable, Mapping

from gcs.results.figures import figure_of

SIMPLEST_FIRST = ("pid", "backstepping", "proposed", "surviving", "tube")
"""Our laws by simplicity. A law of another package counts as less simple than all of them."""
_OWN = ("name", "description", "controller", "trigger", "autopilot")
"""Sections in which the scenarios of the same flight may differ under two laws or autopilots."""
_ASKED = ("controller.reference_bandwidth_rad_s",)
"""What of them says how a law is to fly."""
LEGEND = (
    f"a simpler law (in the order {', '.join(SIMPLEST_FIRST)}) is better by a tenth or more on the "
    "same flights; not tested for significance"
)
ADD_SIMPLER = (
    "give `variants` a copy of one with {controller: {kind: pid}, trigger: {mode: periodic}}"
)
"""How a campaign gets the simplest law."""
_TENTH = 0.1


def simplicity(law: str) -> int:
    """Return the place of a law among ours, the simplest first; laws of others share the last."""
    return SIMPLEST_FIRST.index(law) if law in SIMPLEST_FIRST else len(SIMPLEST_FIRST)


def beaten_by(law: str, cost: float, rivals: Iterable[tuple[str, float]]) -> str | None:
    """Return the simplest of the simpler laws that are better by a tenth or more; None if none is.

    Args:
        law: A law.
        cost: What it came to.
        rivals: Other laws, and what they came to on the same flights.
    """
    own = simplicity(law)
    better = [one for one, other in rivals if simplicity(one) < own and _is_better(other, cost)]
    return min(better, key=simplicity, default=None)


def _is_better(other: float, cost: float) -> bool:
    """Return whether a cost is smaller by a tenth or more of the size of another one."""
    if math.isinf(cost) and cost > 0.0:
        return other < cost
    return other < cost and other <= cost - _TENTH * abs(cost)  # False if one is NaN


def cost_of(name: str, value: float | None) -> float:
    """Return a figure of a UAV, or of a whole flight, as a cost.

    Of a share that should be large, such as a saving, it is what is left of the whole, so that 99
    and 98 % saved differ by a half.

    Args:
        name: Name of the figure, as in iae_roll.
        value: The figure; None where there is none.

    Returns:
        The cost; NaN without a figure, and of one that is neither good nor bad.
    """
    figure = figure_of(name)
    if figure is None or figure.better is None or value is None:
        return math.nan
    if figure.better == "lower":
        return float(value)
    return 1.0 - value if figure.is_share else -float(value)


def law_of(keys: Mapping[str, str]) -> str:
    """Return what flies a scenario, a law or a foreign autopilot; its keys as of `leaves`."""
    autopilot = keys.get("autopilot.kind", "ftc")
    return keys.get("controller.kind", "proposed") if autopilot == "ftc" else autopilot


def flight_of(keys: Mapping[str, str]) -> frozenset[tuple[str, str]]:
    """Return what is flown, whatever the law and its trigger: equal of flights to be compared.

    A law with a slower reference filter does not fly the same: less is asked of it.

    Args:
        keys: Every key of a scenario with its value, as of `leaves`.
    """
    return frozenset(
        (key, value)
        for key, value in keys.items()
        if key in _ASKED or key.partition(".")[0] not in _OWN
    )

"""First-order lag with a limited rate, in closed form: what a servo does to a constant command."""

import math

from mavlink_defs.runtime.jit import compiled


@compiled
def lagged(start: float, target: float, lag: float, limit: float, elapsed: float) -> float:
    """Solve lag · ẋ = target - x with |ẋ| ≤ limit, from x = start.

    While the distance to the target is more than limit · lag, x moves at its limit, and then it
    closes exponentially; the two pieces meet with the same rate.

    Args:
        start: Where it begins.
        target: Where it goes to, same unit.
        lag: Time constant [s]; 0: none.
        limit: Largest rate [units per s]; inf: none.
        elapsed: Time since it began [s].
    """
    if lag == 0.0 and math.isinf(limit):
        return target
    distance = abs(target - start)
    near = limit * lag if lag > 0.0 else 0.0
    running = max(distance - near, 0.0) / limit
    if elapsed < running:
        return start + math.copysign(limit * elapsed, target - start)
    rest = min(distance, near)
    if lag > 0.0:
        rest *= math.exp((running - elapsed) / lag)
    return target - math.copysign(rest, target - start)

"""Numbers in wire fields.

A MAVLink `float` keeps 24 bits: 0.9 arrives as 0.899999976. Both ends of this project mean
decimals of at most six or seven significant digits, which a float32 identifies. Packing raises
for values that a field cannot hold, so measured values pass through `float32s` and
`whole_within` first.
"""

import math
from array import array
from collections.abc import Iterable


def decimal_of_float32(x: float) -> float:
    """Return the shortest decimal that rounds to the same float32 as `x`, as a double.

    A decimal of up to six significant digits (seven in most of the range) sent in a float32
    field comes back exactly. Infinities, NaN and the sign of zero are kept; `x` beyond the
    range of float32 becomes infinite.
    """
    import numpy as np  # for which commands that only talk to vehicles need not wait

    with np.errstate(over="ignore", under="ignore"):
        return float(str(np.float32(x)))


def float32s(values: Iterable[float]) -> list[float]:
    """Return values as float32 fields hold them; what is beyond their range becomes infinite."""
    return array("f", values).tolist()


def whole_within(x: float, low: int, high: int) -> int:
    """Round to a whole number within bounds; NaN becomes the bound nearest to 0."""
    return round(min(max(0.0 if math.isnan(x) else x, low), high))

"""Decimal values through float32 wire fields.

A MAVLink `float` keeps 24 bits: 0.9 arrives as 0.899999976. Both ends of this project mean
decimals of at most six or seven significant digits, and those a float32 does identify.
"""

import numpy as np

__all__ = ["decimal_of_float32"]


def decimal_of_float32(x: float) -> float:
    """Give the shortest decimal that rounds to the same float32 as `x`, as a double.

    A decimal of up to six significant digits (seven in most of the range) sent in a float32
    field comes back exactly. Infinities, NaN and the sign of zero are kept; `x` beyond the
    range of float32 becomes infinite.
    """
    with np.errstate(over="ignore", under="ignore"):
        return float(str(np.float32(x)))

"""Random numbers that depend on what they are for, and on nothing else.

A number is a function of seed, aircraft, channel and index: neither the order in which numbers
are drawn nor the process that draws them matters, and none is drawn by switching a channel on.
The generator is Philox4x32-10: Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy
as 1, 2, 3", SC11, 2011.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled

_LOW = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)
_FACTOR_0, _FACTOR_1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_STEP_0, _STEP_1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)


@compiled
def philox(
    counter: tuple[np.uint64, np.uint64, np.uint64, np.uint64], key: tuple[np.uint64, np.uint64]
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Return four random 32-bit words; `counter` and `key` are 32-bit words as well."""
    c0, c1, c2, c3 = counter
    k0, k1 = key
    for _ in range(10):
        p0, p1 = _FACTOR_0 * c0, _FACTOR_1 * c2
        c0, c1, c2, c3 = ((p1 >> _SHIFT) ^ c1 ^ k0, p1 & _LOW, (p0 >> _SHIFT) ^ c3 ^ k1, p0 & _LOW)
        k0, k1 = (k0 + _STEP_0) & _LOW, (k1 + _STEP_1) & _LOW
    return c0, c1, c2, c3


@compiled
def normal(seed: int, aircraft: int, channel: int, index: int) -> float:
    """Return a number of the standard normal distribution, by the method of Box and Muller.

    Args:
        seed: Seed of the simulation, below 2³².
        aircraft: System id.
        channel: Which of the aircraft's random quantities, below 2³².
        index: Which number of that quantity, 0 or greater.
    """
    radius, angle = _polar(seed, aircraft, channel, index)
    return radius * math.cos(angle)


@compiled
def normals(seed: int, aircraft: int, channel: int, index: int) -> tuple[float, float]:
    """Return `normal`, and a second number that is independent of it, for half the cost of two."""
    radius, angle = _polar(seed, aircraft, channel, index)
    return radius * math.cos(angle), radius * math.sin(angle)


@compiled
def _polar(seed: int, aircraft: int, channel: int, index: int) -> tuple[float, float]:
    """Return radius and angle [rad] of a point whose coordinates are normal and independent."""
    i = np.uint64(index)
    w0, w1, w2, w3 = philox(
        (i & _LOW, i >> _SHIFT, np.uint64(channel), np.uint64(0)),
        (np.uint64(seed), np.uint64(aircraft)),
    )
    radius = math.sqrt(-2.0 * math.log(_fraction(w0, w1)))
    return radius, 2.0 * math.pi * _fraction(w2, w3)


@compiled
def _fraction(high: np.uint64, low: np.uint64) -> float:
    """Return a number of the uniform distribution in (0, 1), from 52 of 64 random bits."""
    bits = (high << np.uint64(20)) | (low >> np.uint64(12))
    return (float(bits) + 0.5) * 2.0**-52

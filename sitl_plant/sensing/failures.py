"""Faults of the navigation sensors of an aircraft: none yet."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled


class SensorRange(NamedTuple):
    """One sensor as its faults need to know it, in units of its samples."""

    sensor: str
    instance: int
    noise: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


class Failures(NamedTuple):
    """The faults of n aircraft with the same u sensors."""

    faults: np.ndarray  # (n, u)


def new_failures(
    ranges: Sequence[SensorRange],
    systems: Sequence[int],
    seed: int,
    step_us: int,
) -> Failures:
    """Return no faults of the sensors of n aircraft."""
    return Failures(np.zeros((len(systems), len(ranges))))


@compiled
def fail(
    failures: Failures,
    i: int,
    unit: int,
    step: int,
    t: float,
    values: np.ndarray,
    fresh: bool,
) -> bool:
    """Let the fault of a sensor act on what it reports; return whether it reports a sample."""
    return fresh

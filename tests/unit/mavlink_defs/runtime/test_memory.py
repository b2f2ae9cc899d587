"""Tables of tuples of arrays, which compiled code indexes."""

from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import borrowed, load_tuple, new_table, store_tuple


class Inner(NamedTuple):
    matrix: np.ndarray
    number: int


class Outer(NamedTuple):
    values: np.ndarray
    inner: Inner
    factor: float


def outer(k: int) -> Outer:
    """Return arrays whose lengths and values depend on k."""
    matrix = np.arange(2.0 * (k + 1)).reshape(k + 1, 2)
    return Outer(np.full(k + 2, float(k)), Inner(matrix, 10 * k), 0.5 * k)


@compiled
def add_to_all(table: np.ndarray, count: int, like: Outer) -> float:
    """Add its inner number to the values of each; return the sum of all that there is."""
    like = borrowed(like)
    total = 0.0
    for k in range(count):
        one = load_tuple(table, k, like)
        for j in range(len(one.values)):
            one.values[j] += one.inner.number
            total += one.values[j]
        for row in range(one.inner.matrix.shape[0]):
            total += one.inner.matrix[row, 1] * one.factor
    return total


def test_compiled_code_reads_and_writes_the_arrays_of_every_entry() -> None:
    tuples = [outer(k) for k in range(3)]
    table = new_table(len(tuples), tuples[0])
    for k, one in enumerate(tuples):
        store_tuple(table, k, one)
    expected = sum(
        float((one.values + one.inner.number).sum() + one.inner.matrix[:, 1].sum() * one.factor)
        for one in tuples
    )
    assert add_to_all(table, len(tuples), tuples[0]) == expected
    for k, one in enumerate(tuples):
        assert one.values.tolist() == [11.0 * k] * (k + 2)

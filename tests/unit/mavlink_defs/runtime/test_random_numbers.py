"""Keyed hash and generator against published values and plain statistics."""

import os
import subprocess
import sys

import numpy as np
import pytest

from mavlink_defs.runtime.random_numbers import (
    GENERATOR_SIZE,
    keyed_hash,
    seed_generator,
    uniform,
)

KEY = np.array([0x03020100, 0x07060504], np.int64)
VECTORS = {0: "218d1f59b9b83cc8", 1: "be552412f8387315", 2: "064f39ef7c50eb57"}
"""HalfSipHash-2-4 of 00 01 02 ..., by length: vectors_hsip64 of the reference implementation."""


@pytest.mark.parametrize("size", VECTORS)
def test_the_hash_matches_the_reference_implementation(size: int) -> None:
    data = np.arange(-3, 64).astype(np.uint8)
    low, high = keyed_hash(KEY, data, 3, 3 + size)
    assert (low | high << 32).to_bytes(8, "little").hex() == VECTORS[size]


def drawn(a: int, b: int, c: int, n: int) -> np.ndarray:
    generator = np.zeros(GENERATOR_SIZE, np.int64)
    seed_generator(generator, a, b, c)
    return np.array([uniform(generator) for _ in range(n)])


def test_numbers_are_uniform_and_sequences_independent() -> None:
    first = np.array([drawn(times, 5, 7, 4) for times in range(5000)])
    assert 0.0 <= first.min() < first.max() < 1.0
    assert first.mean(axis=0) == pytest.approx([0.5] * 4, abs=4.5 / np.sqrt(12 * 5000))
    assert first.var(axis=0) == pytest.approx([1 / 12] * 4, rel=0.05)
    between = np.corrcoef(np.vstack([first.T, np.roll(first[:, 0], 1)]))
    assert np.abs(between - np.eye(5)).max() < 4.5 / np.sqrt(5000)


def test_plain_python_draws_the_same() -> None:
    code = """
import numpy as np
from mavlink_defs.runtime.random_numbers import keyed_hash, seed_generator, uniform
generator = np.zeros(4, np.int64)
seed_generator(generator, *keyed_hash(generator + 2**32 - 1, np.full(9, 200, np.uint8), 0, 9), 3)
print([uniform(generator) for _ in range(100)])
"""
    drawn = {
        subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            env=os.environ | {"NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            check=True,
        ).stdout
        for disabled in ("0", "1")
    }
    assert len(drawn) == 1

"""Random numbers: the generator's published answers, and the distribution."""

import itertools

import numpy as np
import pytest
from scipy import stats

from sitl_plant.air.gaussian import normal, philox

ANSWERS = [  # kat_vectors of Random123 1.14, philox4x32 10: counter, key, result
    ("00000000 00000000 00000000 00000000", "00000000 00000000",
     "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff",
     "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0",
     "d16cfe09 94fdcceb 5001e420 24126ea1"),
]  # fmt: skip
N = 20_000
RECORDED = [-2.245901277482165, 0.11142006397772387, 1.4507874342824678, 2.2428160576364324]


def uint64s(text: str) -> tuple[np.uint64, ...]:
    return tuple(np.uint64(int(number, 16)) for number in text.split())


@pytest.mark.parametrize(("counter", "key", "result"), ANSWERS)
def test_the_generator_gives_the_published_answers(counter: str, key: str, result: str) -> None:
    c0, c1, c2, c3 = uint64s(counter)
    k0, k1 = uint64s(key)
    assert philox((c0, c1, c2, c3), (k0, k1)) == uint64s(result)


def numbers(seed: int, aircraft: int, channel: int) -> np.ndarray:
    return np.array([normal(seed, aircraft, channel, k) for k in range(N)])


def test_numbers_are_normal_and_white() -> None:
    sample = numbers(seed=1, aircraft=2, channel=3)
    assert stats.kstest(sample, "norm").pvalue > 0.01
    spectrum = np.abs(np.fft.rfft(sample))[1:-1] ** 2 / N  # exponential, mean 1, if it is white
    assert stats.kstest(spectrum, "expon").pvalue > 0.01


def test_seed_aircraft_and_channel_each_make_other_numbers() -> None:
    series = [numbers(*key) for key in itertools.product((1, 2), (1, 2), (0, 1))]
    correlations = np.corrcoef(series)[~np.eye(len(series), dtype=bool)]
    assert np.abs(correlations).max() < 4.0 / np.sqrt(N)


def test_a_seed_gives_the_same_flight_in_every_version() -> None:
    found = [normal(7, aircraft, channel, 12) for aircraft in (1, 2) for channel in (0, 5)]
    assert found == RECORDED

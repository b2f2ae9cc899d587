"""The windowed regression, against weighted moments that numpy computes from all samples."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.diagnosis.regression import estimate, learn, long_estimate, restart
from ftc_autopilot.control.diagnosis.state import ACTUATOR

DT, WINDOW, FILTER = 1e-3, 0.02, 0.01
LONG_S = 0.3

samples = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=2, max_size=60)


def learned(u: np.ndarray, y: np.ndarray) -> np.void:
    """The record after these pairs."""
    actuator: np.void = np.zeros(1, ACTUATOR)[0]
    actuator["commanded"], actuator["measured"] = u[0], y[0]
    restart(actuator)
    for commanded, measured in zip(u, y, strict=True):
        actuator["commanded"], actuator["measured"] = commanded, measured
        learn(actuator, WINDOW, LONG_S, DT)
    return actuator


def weights(n: int) -> np.ndarray:
    """What each of n samples counts: a plain mean at first, then an exponential window."""
    k = np.maximum(1.0 / np.arange(1, n + 1), DT / WINDOW)
    kept = np.append(np.cumprod((1.0 - k[1:])[::-1])[::-1], 1.0)
    return np.asarray(k * kept)


@given(samples)
def test_moments_are_taken_over_the_weighted_samples(pairs: list[tuple[float, float]]) -> None:
    u, y = np.array(pairs).T
    actuator, w = learned(u, y), weights(len(u))
    assert w.sum() == pytest.approx(1.0)
    assert actuator["mean_u"] == pytest.approx(w @ u, abs=1e-12)
    cov = np.cov(u, y, aweights=w, ddof=0)
    assert actuator["var_u"] == pytest.approx(cov[0, 0], abs=1e-12)
    assert actuator["cov"] == pytest.approx(cov[0, 1], abs=1e-12)
    assert actuator["var_y"] == pytest.approx(cov[1, 1], abs=1e-12)


@pytest.mark.parametrize("effectiveness", [0.0, 0.1, 0.5, 1.0])
def test_effectiveness_is_found_whatever_the_offset(effectiveness: float) -> None:
    u = np.repeat([0.0, 0.1, -0.05, 0.07], 10)
    actuator = learned(u, effectiveness * u + 0.3)
    prior = 0.002
    spread = np.cov(u, u, aweights=weights(len(u)), ddof=0)[0, 0]
    found, _ = estimate(actuator, prior, WINDOW, FILTER, DT)
    assert found == pytest.approx((effectiveness * spread + prior**2) / (spread + prior**2))
    assert found == pytest.approx(effectiveness, abs=0.01)


def test_without_excitation_the_actuator_counts_as_healthy_and_nothing_is_certain() -> None:
    rng = np.random.default_rng(1)
    actuator = learned(np.full(50, 0.1), 0.1 + 1e-3 * rng.standard_normal(50))
    actuator["variance"] = 0.005**2
    effectiveness, error = estimate(actuator, 0.005, WINDOW, FILTER, DT)
    assert effectiveness == pytest.approx(1.0)
    assert error == pytest.approx(1.0)  # as much noise as the prior weighs, one sample
    assert long_estimate(actuator, 0.005) == pytest.approx(1.0)


def test_the_standard_error_matches_the_scatter() -> None:
    """Over many draws of independent noise the estimates scatter as much as they say."""
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-0.05, 0.05], 30), 2)
    noise, prior, tiny = 0.01, 1e-9, 0.5e-3
    found = []
    for _ in range(2000):
        actuator = learned(u, 0.4 * u + noise * rng.standard_normal(len(u)))
        actuator["variance"] = noise**2
        effectiveness, error = estimate(actuator, prior, WINDOW, tiny, DT)
        found.append(effectiveness)
    w = weights(len(u))
    true = noise * math.sqrt(w @ w) / math.sqrt(actuator["var_u"])  # of a weighted slope, roughly
    assert np.mean(found) == pytest.approx(0.4, abs=0.01)
    assert np.std(found) == pytest.approx(true, rel=0.25)
    assert 0.5 * error < np.std(found) < 1.5 * error

"""Turbulence against MIL-F-8785C: its spectra by scipy.signal, its discretisation by van Loan."""

import functools
import itertools
import math

import numpy as np
import pytest
from scipy import linalg, signal

from sitl_plant.air.config import Dryden
from sitl_plant.air.gaussian import normal
from sitl_plant.air.turbulence import advance_turbulence, dryden, new_turbulence, start_turbulence

V, SPAN = 50.0, 1.96
MODEL = Dryden(
    sigma_u_m_s=1.5, sigma_v_m_s=1.2, sigma_w_m_s=0.8,
    length_u_m=200.0, length_v_m=150.0, length_w_m=50.0,
)  # fmt: skip
FEET = 0.3048


def test_intensities_are_the_standards() -> None:
    """MIL-F-8785C, fig. 10 and 11: wind of 15, 30, 45 knots at 20 ft; at 1000 ft all are equal."""
    for name, knots in (("light", 15.0), ("moderate", 30.0), ("severe", 45.0)):
        low, high = dryden(name, 100.0), dryden(name, 1000.0 * FEET)
        sigma_w = 0.1 * knots * 1852.0 / 3600.0
        assert low.sigma_w_m_s == pytest.approx(sigma_w)
        assert low.length_w_m == pytest.approx(100.0)
        share = 0.177 + 0.000823 * 100.0 / FEET
        assert low.sigma_u_m_s == low.sigma_v_m_s == pytest.approx(sigma_w / share**0.4)
        assert low.length_u_m == low.length_v_m == pytest.approx(100.0 / share**1.2)
        assert high.sigma_u_m_s == pytest.approx(high.sigma_w_m_s, rel=1e-3)
        assert high.length_u_m == pytest.approx(1000.0 * FEET, rel=1e-3)
        assert dryden(name, 5000.0) == high
    assert dryden("light", 100.0).sigma_w_m_s == pytest.approx(0.77, abs=0.002)
    assert dryden("none", 100.0).sigma_u_m_s == 0.0


@functools.cache
def flown(dt: float, steps: int) -> np.ndarray:
    """Velocity and rates of the air at constant airspeed, shape (steps, 6)."""
    air, seen = new_turbulence(MODEL, SPAN), np.empty((steps, 6))
    start_turbulence(air, V, 1, 1)
    for k in range(steps):
        advance_turbulence(air, V, dt, 1, 1, k + 1)
        seen[k] = (*air["velocity"], *air["rates"])
    return seen


def transfer_functions() -> list[tuple[list[float], list[float]]]:
    """u, v, w, p, q, r: numerator and denominator in s, of MIL-F-8785C, section 3.7.1.2."""
    s = (MODEL.sigma_u_m_s, MODEL.sigma_v_m_s, MODEL.sigma_w_m_s)
    lag = [length / V for length in (MODEL.length_u_m, MODEL.length_v_m, MODEL.length_w_m)]
    u = ([s[0] * math.sqrt(2.0 * lag[0] / math.pi)], [lag[0], 1.0])
    v, w = (
        (
            [s[i] * math.sqrt(lag[i] / math.pi) * c for c in (math.sqrt(3.0) * lag[i], 1.0)],
            [lag[i] ** 2, 2.0 * lag[i], 1.0],
        )
        for i in (1, 2)
    )
    slow = 4.0 * SPAN / (math.pi * V)
    gain = s[2] * math.sqrt(0.8 / V) * (math.pi / (4.0 * SPAN)) ** (1.0 / 6.0)
    p = ([gain / MODEL.length_w_m ** (1.0 / 3.0)], [slow, 1.0])
    q = ([*(-c / V for c in w[0]), 0.0], list(np.polymul(w[1], [slow, 1.0])))
    r = ([*(c / V for c in v[0]), 0.0], list(np.polymul(v[1], [0.75 * slow, 1.0])))
    return [u, v, w, p, q, r]


@pytest.mark.parametrize("k", range(6), ids="uvwpqr")
def test_spectra_follow_from_the_transfer_functions(k: int) -> None:
    dt = 0.01
    f, measured = signal.welch(flown(dt, 2**17)[:, k], 1.0 / dt, nperseg=4096)
    _, response = signal.freqs(*transfer_functions()[k], worN=2.0 * math.pi * f[1:])
    expected = 2.0 * math.pi * np.abs(response) ** 2  # per Hz, one-sided
    ratio = measured[1:] / expected
    edges = np.array([0.05, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0])
    for low, high in itertools.pairwise(edges):
        band = (f[1:] >= low) & (f[1:] < high)
        scatter = 4.0 / math.sqrt(30.0 * band.sum())  # of a mean over Welch's 60 segments
        assert ratio[band].mean() == pytest.approx(1.0, abs=0.03 + scatter), (low, high)


def test_it_begins_stationary_and_stays_so() -> None:
    """Over 400 aircraft, at once and after one period as long as the turbulence's memory."""
    sigma = np.array([MODEL.sigma_u_m_s, MODEL.sigma_v_m_s, MODEL.sigma_w_m_s])
    first, later = [], []
    for aircraft in range(400):
        air = new_turbulence(MODEL, SPAN)
        start_turbulence(air, V, 1, aircraft)
        first.append(air["velocity"].copy())
        advance_turbulence(air, V, 2.0, 1, aircraft, 1)
        later.append(air["velocity"].copy())
    for sample in (first, later):
        assert np.std(sample, axis=0) == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize("dt", [1e-5, 1e-3, 0.1, 3.0])
def test_a_period_is_discretised_exactly(dt: float) -> None:
    """Of v: transition and noise covariance of two lags of white noise, by van Loan's method."""
    air = new_turbulence(MODEL, SPAN)
    start_turbulence(air, V, 1, 1)
    before = np.array([air["first"][1], air["second"][1]])
    advance_turbulence(air, V, dt, 1, 1, 1)
    rate = V / MODEL.length_v_m
    A = rate * np.array([[-1.0, 0.0], [1.0, -1.0]])
    noise = np.diag([rate, 0.0])  # intensity such that the first lag has variance 1/2
    block = linalg.expm(np.block([[-A, noise], [np.zeros((2, 2)), A.T]]) * dt)
    transition = block[2:, 2:].T
    root = linalg.cholesky(transition @ block[:2, 2:], lower=True)
    drawn = np.array([normal(1, 1, 202, 1), normal(1, 1, 203, 1)])
    after = np.array([air["first"][1], air["second"][1]])
    assert after == pytest.approx(transition @ before + root @ drawn, rel=1e-6)

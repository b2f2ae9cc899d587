"""The regression on the dither alone: right where the loop counteracts, and where it is late."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.diagnosis.instrument import (
    LAGS,
    estimate_by_dither,
    lag_steps,
    learn_instrument,
    restart_instrument,
)
from ftc_autopilot.control.diagnosis.state import ACTUATOR

DT, FILTER_S, MEMORY_S, HALF_S, SIZE = 1e-3, 0.01, 0.15, 0.035, math.radians(4.0)


def estimated(
    rho: float,
    swing: float,
    frequency_hz: float,
    noise: float,
    late_s: float,
    lags: int,
    jump: float = 0.0,
    after_jump: bool = False,
    seconds: float = 0.3,
) -> tuple[float, float, int]:
    """Estimate of an actuator with ρ and a swinging offset, which the loop counteracts in full.

    The offset has also jumped, before the filter of the measurement shows any of it.
    """
    actuator = np.zeros(1, ACTUATOR)[0]
    restart_instrument(actuator, after_jump)
    random = np.random.default_rng(1)
    u = y = 0.0
    dithers = np.where(np.arange(300) * DT % (2.0 * HALF_S) < HALF_S, SIZE, 0.0)
    offsets = swing * np.sin(2.0 * np.pi * frequency_hz * np.arange(300) * DT)
    commands = dithers - offsets
    late = round(late_s / DT)
    for k in range(round(seconds / DT)):
        u += DT / FILTER_S * (commands[k] - u)
        does = rho * commands[max(k - late, 0)] + offsets[k] + jump
        y += DT / FILTER_S * (does - y)
        actuator["commanded"] = u
        actuator["measured"] = y + noise * random.standard_normal()
        learn_instrument(actuator, dithers[k], lags, 0.0, FILTER_S, MEMORY_S, DT)
    return estimate_by_dither(actuator, lags, FILTER_S, DT)


@given(
    rho=st.floats(0.0, 1.2),
    swing_deg=st.floats(0.0, 10.0),
    frequency_hz=st.floats(0.1, 2.0),
)
def test_what_the_loop_counteracts_does_not_fool_it(
    rho: float, swing_deg: float, frequency_hz: float
) -> None:
    found, error, _ = estimated(rho, math.radians(swing_deg), frequency_hz, 0.0, 0.0, 1)
    assert abs(found - rho) < 3.0 * error + 0.02


@given(rho=st.floats(0.0, 1.2), noise_deg=st.floats(0.1, 1.0))
def test_its_error_is_that_of_the_noise(rho: float, noise_deg: float) -> None:
    found, error, _ = estimated(rho, 0.0, 1.0, math.radians(noise_deg), 0.0, 1)
    assert abs(found - rho) < 4.0 * error
    assert error > 0.0


@given(rho=st.floats(0.0, 1.2), jump_deg=st.floats(-25.0, 25.0), seconds=st.floats(0.07, 0.3))
def test_the_tail_of_the_jump_is_not_taken_for_a_movement(
    rho: float, jump_deg: float, seconds: float
) -> None:
    """Of a rudder that stuck 20 deg from its command it hid that no movement followed."""
    jump = math.radians(jump_deg)
    found, error, _ = estimated(rho, 0.0, 1.0, 0.0, 0.0, 1, jump, True, seconds)
    assert found == pytest.approx(rho, abs=1e-6)
    assert error < 1e-4


def test_a_tail_that_is_not_expected_makes_the_error_large() -> None:
    _, error, _ = estimated(0.0, 0.0, 1.0, 0.0, 0.0, 1, math.radians(18.0), False, 0.075)
    assert error > 0.1


@pytest.mark.parametrize(("after_jump", "filters"), [(False, 4), (True, 5)])
def test_as_many_independent_samples_as_numbers_have_no_error(
    after_jump: bool, filters: int
) -> None:
    """The memory of 0.15 s leaves 5 of 6 filters' time constants, and 4 of 5."""
    independent = MEMORY_S / FILTER_S * (1.0 - (1.0 - DT / MEMORY_S) ** np.arange(1, 100))
    first = int(np.argmax(independent > filters)) + 1
    for steps, known in ((first - 1, False), (first, True)):
        _, error, _ = estimated(
            1.0, 0.0, 1.0, 1e-3, 0.0, 1, after_jump=after_jump, seconds=steps * DT
        )
        assert math.isfinite(error) == known


@pytest.mark.parametrize("lag", range(LAGS))
def test_the_dead_time_is_found(lag: int) -> None:
    late_s = lag_steps(lag, DT) * DT
    found, _, best = estimated(1.0, 0.0, 1.0, 0.0, late_s, LAGS)
    assert found == pytest.approx(1.0, abs=0.1)
    assert best == lag


def test_without_dither_nothing_is_known() -> None:
    actuator = np.zeros(1, ACTUATOR)[0]
    restart_instrument(actuator, False)
    for k in range(200):
        actuator["commanded"] = actuator["measured"] = math.sin(0.1 * k)
        learn_instrument(actuator, 0.0, 1, 0.0, FILTER_S, MEMORY_S, DT)
    assert estimate_by_dither(actuator, 1, FILTER_S, DT) == (1.0, math.inf, 0)

"""A receiver that is later than it says is found by its velocity, in turns; nothing else is."""

import math

import numpy as np
import pytest

from ftc_autopilot.estimation.config import PARAMETERS
from ftc_autopilot.estimation.latency import LATENCY, note_velocity
from ftc_autopilot.estimation.receiver import FIX
from ftc_autopilot.estimation.state import TRAVEL

NOISE_M_S = 0.05


def velocity_at(time_s: float, turns: bool) -> np.ndarray:
    """Of an aircraft that weaves, or goes straight on [m/s]."""
    course = 0.5 * math.sin(0.6 * time_s) if turns else 0.0
    return 40.0 * np.array([math.cos(course), math.sin(course), 0.0])


def learned(
    late_s: float,
    turns: bool,
    drift_m_s2: float = 0.0,
    stated_s: float = 0.2,
    every: int = 10,
    noise_m_s: float = NOISE_M_S,
) -> float:
    """Return the delay after 30 s of a receiver that is later than it says by `late_s`.

    It reports once in so many steps of 10 ms.
    """
    random = np.random.default_rng(3)
    latency, fix = np.zeros(1, LATENCY)[0], np.zeros(1, FIX)[0]
    assumed = np.zeros(1, PARAMETERS)[0]
    assumed["gnss_velocity"] = noise_m_s**2
    history, past = np.zeros((120, TRAVEL)), np.zeros(TRAVEL)
    for step in range(3000):
        now = 0.01 * step
        travel = history[step % len(history)]
        travel[:3] = velocity_at(now, turns) - velocity_at(0.0, turns)
        travel[0] += drift_m_s2 * now  # of an accelerometer, or of a tilt
        travel[6] = now
        if step % every == 0 and now > 2.0:
            then = velocity_at(now - stated_s - late_s, turns)
            fix["velocity"] = then + random.normal(0.0, noise_m_s, 3)
            note_velocity(latency, history, travel.copy(), fix, stated_s, past, assumed)
    return float(latency["delay"])


@pytest.mark.parametrize("every", [10, 100])
@pytest.mark.parametrize("late_s", [-0.2, 0.15, 0.3, 0.5])
def test_a_delay_shows_in_turns(late_s: float, every: int) -> None:
    assert learned(late_s, turns=True, every=every) == pytest.approx(late_s, abs=0.051)


@pytest.mark.parametrize("late_s", [-0.25, 0.25])
def test_noise_that_is_known_hides_no_delay(late_s: float) -> None:
    """Of a small receiver, once a second: half of the scatter is its noise."""
    found = learned(late_s, turns=True, stated_s=0.3, every=100, noise_m_s=0.7)
    assert found == pytest.approx(late_s, abs=0.11)


@pytest.mark.parametrize("drift_m_s2", [0.0, 0.1])
@pytest.mark.parametrize("turns", [True, False])
def test_no_delay_is_made_up(turns: bool, drift_m_s2: float) -> None:
    assert learned(0.0, turns, drift_m_s2) == 0.0


def test_straight_flight_says_nothing() -> None:
    assert learned(0.3, turns=False) == 0.0


def test_a_delay_beyond_what_is_tried_is_none_of_them() -> None:
    assert learned(1.0, turns=True) == 0.0

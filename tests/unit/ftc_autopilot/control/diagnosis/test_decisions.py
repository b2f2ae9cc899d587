"""A suspicion: raised by a jump smaller than the noise, ended by a movement that is followed."""

import math

import numpy as np

from ftc_autopilot.control.diagnosis.decisions import (
    HEALTHY,
    LOST,
    SUSPECT,
    decide,
    phase_of,
    watch,
)
from ftc_autopilot.control.diagnosis.parameters import Thresholds
from ftc_autopilot.control.diagnosis.state import ACTUATOR

DT, FILTER_S, SIGMAS, SMOOTH_SIGMAS = 0.001, 0.01, 5.0, 4.2
DEGREE = math.radians(1.0)
LIMITS = Thresholds(
    jump=2.0 * DEGREE,
    smooth_jump=0.15 * DEGREE,
    excitation=1.2 * DEGREE,
    prior=0.4 * DEGREE,
    window=0.06,
    confirm=0.008,
    offset=0.06,
    suspicion=0.6,
    ahead=0.005,
    quiet=0.52,
)


def noise(steps: int) -> np.ndarray:
    """What a gyro's white noise makes of y: the rates' derivative, 0.5 deg rms."""
    white = np.random.default_rng(2).standard_normal(steps)
    filtered, fast = 0.0, np.empty(steps)
    for k in range(steps):
        fast[k] = white[k] - filtered
        filtered += DT / FILTER_S * fast[k]
    return np.asarray(0.5 * DEGREE * fast / fast.std())


def diagnosed(u: np.ndarray, y: np.ndarray) -> list[int]:
    """Phases of an actuator that is told u and does y."""
    actuator = np.zeros(1, ACTUATOR)[0]
    phases = []
    for k in range(len(u)):
        actuator["commanded"], actuator["measured"] = u[k], y[k]
        age = (k + 1) * DT
        watch(actuator, LIMITS, age, DT, FILTER_S, SIGMAS, SMOOTH_SIGMAS)
        decide(actuator, LIMITS, age, DT, FILTER_S, 0.2, False)
        phases.append(int(phase_of(actuator)))
    return phases


def test_a_jump_smaller_than_the_noise_raises_suspicion() -> None:
    y = noise(4000)
    assert set(diagnosed(np.zeros(4000), y)) == {HEALTHY}
    y[3000:] += 0.8 * DEGREE * (1.0 - np.exp(-np.arange(1000) * DT / FILTER_S))
    phases = diagnosed(np.zeros(4000), y)
    assert set(phases[:3000]) == {HEALTHY}
    assert SUSPECT in phases[3000:3040]


def test_a_suspicion_ends_when_the_surface_follows_or_does_not() -> None:
    u, y = np.zeros(4000), noise(4000)
    y[3000:] += 5.0 * DEGREE * (1.0 - np.exp(-np.arange(1000) * DT / FILTER_S))
    u[3030:] -= 8.0 * DEGREE * (1.0 - np.exp(-np.arange(970) * DT / FILTER_S))
    assert diagnosed(u, y + u)[3080] == HEALTHY
    assert diagnosed(0.0 * u, y)[3080] == SUSPECT
    assert diagnosed(u, y)[3080] == LOST

"""A suspicion: raised by a jump smaller than the noise, ended by a movement that is followed."""

import math

import actuators
import numpy as np
import pytest
from actuators import DT, FILTER_S

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.diagnosis.decisions import decide, phase_of
from ftc_autopilot.control.diagnosis.parameters import DiagnosisParameters
from ftc_autopilot.control.diagnosis.state import ACTUATOR
from ftc_autopilot.control.diagnosis.suspicions import monitor
from sitl_plant.actuators.config import ActuatorServos

DEGREE = math.radians(1.0)
LIMITS = actuators.LIMITS._replace(
    smooth_jump=0.15 * DEGREE,
    **{
        name: DEGREE * getattr(actuators.LIMITS, name)
        for name in ("jump", "swing", "excitation", "prior")
    },
)
GAINS = np.zeros(1, record_dtype(DiagnosisParameters))[0]
fill(GAINS, DiagnosisParameters(smooth_jump_sigma=4.2).with_servos(ActuatorServos()))


def noise(steps: int) -> np.ndarray:
    """What a gyro's white noise makes of y: the rates' derivative, 0.5 deg rms."""
    white = np.random.default_rng(2).standard_normal(steps)
    filtered, fast = 0.0, np.empty(steps)
    for k in range(steps):
        fast[k] = white[k] - filtered
        filtered += DT / FILTER_S * fast[k]
    return np.asarray(0.5 * DEGREE * fast / fast.std())


def diagnosed(u: np.ndarray, y: np.ndarray) -> list[int]:
    """Phases of an actuator that is commanded u and does y."""
    actuator = np.zeros(1, ACTUATOR)[0]
    actuator["effectiveness"] = 1.0
    phases = []
    for k in range(len(u)):
        actuator["commanded"], actuator["measured"] = u[k], y[k]
        age = (k + 1) * DT
        monitor(actuator, LIMITS, age, DT, GAINS)
        decide(actuator, 0.0, LIMITS, age, DT, GAINS, False)
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


def jump_at_3_s(size_deg: float, steps: int = 4000) -> np.ndarray:
    """Residual that jumps, as the measurement's filter shows it [rad]."""
    y = np.zeros(steps)
    y[3000:] = size_deg * DEGREE * (1.0 - np.exp(-np.arange(steps - 3000) * DT / FILTER_S))
    return y


def first_moved(y: np.ndarray) -> tuple[int, int]:
    """Steps at which a quiet actuator becomes suspect, and is moved."""
    actuator = np.zeros(1, ACTUATOR)[0]
    actuator["effectiveness"] = 1.0
    suspect = -1
    for k in range(len(y)):
        actuator["measured"] = y[k]
        monitor(actuator, LIMITS, (k + 1) * DT, DT, GAINS)
        if phase_of(actuator) == SUSPECT:
            suspect = k if suspect < 0 else suspect
            if actuator["dither_s"] > 0.0:
                return suspect, k
    return suspect, -1


def test_a_slight_jump_moves_the_surface_at_once_and_a_large_one_later() -> None:
    suspect, moved = first_moved(jump_at_3_s(1.8 * LIMITS.smooth_jump / DEGREE))
    assert suspect == moved >= 3000
    suspect, moved = first_moved(jump_at_3_s(9.0 * LIMITS.jump / DEGREE))
    assert moved * DT == pytest.approx(suspect * DT + 1.5 * FILTER_S - LIMITS.ahead, abs=2 * DT)


@pytest.mark.parametrize(("size_deg", "renewed"), [(0.5, False), (5.0, True)])
def test_a_slight_jump_waits_longer_until_a_suspicion_may_be_renewed(
    size_deg: float, renewed: bool
) -> None:
    y = jump_at_3_s(5.0, 6000)
    y[5800:] += size_deg * DEGREE  # 2.8 s after the first: within 0.6 + 2.5 s, not within 0.6 + 2
    phases = diagnosed(np.zeros(6000), y)
    assert SUSPECT in phases[3000:3100]
    assert set(phases[3700:5800]) == {HEALTHY}
    assert (SUSPECT in phases[5800:]) == renewed

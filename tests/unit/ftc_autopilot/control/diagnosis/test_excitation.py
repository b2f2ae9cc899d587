"""Movements of a suspect or lost actuator: how far, to which side, how fast, and never too far."""

import math

import numpy as np
import pytest

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.diagnosis import DIAGNOSIS, DiagnosisParameters
from ftc_autopilot.control.diagnosis.excitation import dithered, dithered_thrust, probe, probed
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from sitl_plant.actuators.config import ActuatorServos

GAINS = np.zeros(1, record_dtype(DiagnosisParameters))[0]
fill(GAINS, DiagnosisParameters().with_servos(ActuatorServos()))
STOP, LIMIT = math.radians(35.0), 1800.0
SIZES = np.radians([4.0, 10.0, 12.0])
HALVES = (0.035, 0.035, 0.05)  # periods of the surfaces' dithers [s]


def suspect(j: int, dither_s: float, sign: float = 1.0) -> np.void:
    """State in which an actuator is suspect, and has been moved for a time."""
    state: np.void = np.zeros(1, DIAGNOSIS)[0]
    actuator = state["actuators"][j]
    actuator["suspect_s"], actuator["dither_s"], actuator["dither_sign"] = 0.3, dither_s, sign
    return state


@pytest.mark.parametrize("j", [AILERON, ELEVATOR, RUDDER])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_suspect_surface_is_moved_to_one_side_and_back(j: int, sign: float) -> None:
    for halves in range(6):
        for within in (0.01, 0.99):
            state = suspect(j, (halves + within) * HALVES[j], sign)
            moved = sign * SIZES[j] if halves % 2 == 0 else 0.0
            assert dithered(0.1, j, (-STOP, STOP), GAINS, state) == pytest.approx(0.1 + moved)
            assert state["actuators"][j]["dither"] == pytest.approx(moved)


@pytest.mark.parametrize("j", [AILERON, ELEVATOR, RUDDER])
def test_a_surface_near_its_stop_is_moved_toward_zero(j: int) -> None:
    for delta in (STOP - 0.9 * SIZES[j], STOP, 0.8):
        for sign in (1.0, -1.0):
            for side in (1.0, -1.0):
                state = suspect(j, 0.01, sign)
                expected = side * (min(delta, STOP) - SIZES[j])
                assert dithered(side * delta, j, (-STOP, STOP), GAINS, state) == pytest.approx(
                    expected
                )
    room = STOP - 1.01 * SIZES[j]
    assert dithered(room, j, (-STOP, STOP), GAINS, suspect(j, 0.01)) == pytest.approx(
        room + SIZES[j]
    )


@pytest.mark.parametrize("changed", [{"suspect_s": 0.0}, {"dither_s": 0.0}, {"lost": 1}])
def test_no_other_surface_is_moved(changed: dict[str, float]) -> None:
    state = suspect(ELEVATOR, 0.01)
    for name, value in changed.items():
        state["actuators"][ELEVATOR][name] = value
    state["actuators"][ELEVATOR]["dither"] = 0.5
    assert dithered(0.8, ELEVATOR, (-STOP, STOP), GAINS, state) == 0.8
    assert state["actuators"][ELEVATOR]["dither"] == (0.5 if "lost" in changed else 0.0)
    assert dithered(0.8, AILERON, (-STOP, STOP), GAINS, state) == 0.8


@pytest.mark.parametrize("thrust", [-50.0, 0.0, 100.0, 900.0, 1700.0, 1800.0, 2500.0])
def test_a_suspect_throttle_is_moved_up_and_down_within_its_limits(thrust: float) -> None:
    middle = min(max(thrust, 120.0), 1680.0)
    for halves in range(4):
        for within in (0.01, 0.99):
            state = suspect(THROTTLE, (halves + within) * 0.06)
            moved = 120.0 if halves % 2 == 0 else -120.0
            sent = dithered_thrust(thrust, LIMIT, GAINS, state)
            assert sent == pytest.approx(middle + moved)
            assert 0.0 <= sent <= LIMIT
            assert state["actuators"][THROTTLE]["dither"] == moved


@pytest.mark.parametrize("changed", [{"suspect_s": 0.0}, {"dither_s": 0.0}, {"lost": 1}])
def test_no_other_throttle_is_moved(changed: dict[str, float]) -> None:
    state = suspect(THROTTLE, 0.01)
    for name, value in changed.items():
        state["actuators"][THROTTLE][name] = value
    state["actuators"][THROTTLE]["dither"] = 50.0
    assert dithered_thrust(2500.0, LIMIT, GAINS, state) == 2500.0
    assert state["actuators"][THROTTLE]["dither"] == 0.0


def test_a_probe_changes_its_side_every_half_second() -> None:
    state = np.zeros(1, DIAGNOSIS)[0]
    for j, size in enumerate((*np.radians([2.0, 2.5, 4.0]), 100.0)):
        for age, side in ((0.01, 1.0), (0.49, 1.0), (0.51, -1.0), (0.99, -1.0), (1.01, 1.0)):
            state["age"] = age
            assert probe(j, GAINS, state) == pytest.approx(side * size)


@pytest.mark.parametrize("j", [AILERON, ELEVATOR, RUDDER])
def test_a_lost_surface_is_tried_at_first_and_then_probed(j: int) -> None:
    """About where it is stuck: for 0.6 s far and fast to either side, then by the probe."""
    state = np.zeros(1, DIAGNOSIS)[0]
    state["age"], actuator = 0.2, state["actuators"][j]
    trial, small = np.radians([10.0, 10.0, 12.0])[j], np.radians([2.0, 2.5, 4.0])[j]
    for halves in range(10):
        actuator["decided_s"] = (halves + 0.99) * HALVES[j]
        move = trial if halves % 2 == 0 else -trial
        assert probed(j, -0.2, GAINS, state) == pytest.approx(-0.2 + move)
        assert actuator["dither"] == pytest.approx(move)
    for decided_s in (0.6, 0.61, 9.0):
        actuator["decided_s"] = decided_s
        assert probed(j, -0.2, GAINS, state) == pytest.approx(-0.2 + small)
        assert actuator["dither"] == 0.0

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_faults import actuator_fault, add_fault

from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, DRIFT, HARDOVER, INTERMITTENT
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.table import no_faults
from sitl_plant.actuators.faults import apply_faults, servo_command

COMMAND = (0.1, -0.2, 0.3, 150.0)
NAN = math.nan
RUDDER, THROTTLE = 2, 3


def row_with(*faults: Fault, now_s: float = 0.0) -> np.ndarray:
    row: np.ndarray = no_faults(ACTUATOR_FAULTS, 1)[0]
    for fault in faults:
        add_fault(row, fault, now_s)
    return row


def applied(row: np.ndarray, t: float, aircraft: np.void) -> tuple[float, ...]:
    return apply_faults(COMMAND, t, t, row, aircraft)


def test_without_faults_commands_are_applied(nominal: np.void) -> None:
    assert applied(row_with(), 1.0, nominal) == COMMAND


def test_partial_loss_scales_one_actuator(nominal: np.void) -> None:
    row = row_with(actuator_fault(RUDDER, 0.9, 0.0, 0.0, 0.0, NAN))
    assert applied(row, 1.0, nominal) == (0.1, -0.2, 0.9 * 0.3, 150.0)


def test_loss_and_bias_come_together(nominal: np.void) -> None:
    row = row_with(actuator_fault(RUDDER, 0.9, 1.0, 0.0, 0.0, NAN))
    assert applied(row, 1.0, nominal)[2] == 0.9 * 0.3 + math.radians(1.0)


def test_bias_of_the_throttle_is_in_newton(nominal: np.void) -> None:
    row = row_with(actuator_fault(THROTTLE, 1.0, -20.0, 0.0, 0.0, NAN))
    assert applied(row, 1.0, nominal)[3] == 130.0


def test_a_stuck_actuator_does_not_listen(nominal: np.void) -> None:
    row = row_with(actuator_fault(RUDDER, 0.0, 5.0, 0.0, 0.0, NAN))
    assert applied(row, 1.0, nominal)[2] == math.radians(5.0)


@given(t=st.floats(2.0, 9.0), frequency=st.floats(0.1, 5.0))
def test_a_stuck_value_can_vary_in_time(t: float, frequency: float, nominal: np.void) -> None:
    row = row_with(actuator_fault(RUDDER, 0.0, 5.0, frequency, 2.0, 10.0))
    expected = math.radians(5.0) * math.cos(2.0 * math.pi * frequency * (t - 2.0))
    assert applied(row, t, nominal)[2] == pytest.approx(expected, abs=1e-12)


@given(t=st.floats(2.0, 9.0), frequency=st.floats(0.0, 5.0), effectiveness=st.floats(0.0, 1.0))
def test_a_drift_grows_from_its_start(
    t: float, frequency: float, effectiveness: float, nominal: np.void
) -> None:
    row = row_with(actuator_fault(RUDDER, effectiveness, -0.4, frequency, 2.0, 10.0, DRIFT.code))
    wave = math.cos(2.0 * math.pi * frequency * (t - 2.0))
    expected = effectiveness * COMMAND[RUDDER] - math.radians(0.4) * (t - 2.0) * wave
    assert applied(row, t, nominal)[RUDDER] == pytest.approx(expected, abs=1e-12)


def test_a_drift_ends_at_the_stop(nominal: np.void) -> None:
    row = row_with(actuator_fault(RUDDER, 1.0, 10.0, 0.0, 0.0, NAN, DRIFT.code))
    assert applied(row, 9.0, nominal)[RUDDER] == nominal["stops"][RUDDER, 1]


@given(since_s=st.integers(0, 7_999).map(lambda n: n / 1000), half_s=st.sampled_from([0.25, 2.0]))
def test_an_intermittent_fault_comes_and_goes(
    since_s: float, half_s: float, nominal: np.void
) -> None:
    row = row_with(actuator_fault(RUDDER, 0.5, 3.0, 0.5 / half_s, 2.0, 10.0, INTERMITTENT.code))
    is_on = int(since_s / half_s) % 2 == 0
    expected = 0.5 * COMMAND[RUDDER] + math.radians(3.0) if is_on else COMMAND[RUDDER]
    assert applied(row, 2.0 + since_s, nominal)[RUDDER] == pytest.approx(expected)


def test_a_hard_over_is_the_servo_s(nominal: np.void) -> None:
    """Then the actuator is where its servo is, which follows other commands than it receives."""
    row = row_with(actuator_fault(RUDDER, 0.0, -12.0, 0.0, 2.0, 10.0, HARDOVER.code))
    assert applied(row, 5.0, nominal) == COMMAND
    commands = {
        t: [servo_command(0.1, channel, row, t) for channel in range(4)] for t in (1.9, 2.0, 9.9)
    }
    assert commands[1.9] == [0.1, 0.1, 0.1, 0.1]
    assert commands[2.0] == commands[9.9] == [0.1, 0.1, math.radians(-12.0), 0.1]


@pytest.mark.parametrize(
    ("interval_start", "active"), [(18.999, False), (19.0, True), (21.999, True), (22.0, False)]
)
def test_a_window_begins_after_its_start_and_holds_to_its_end(
    interval_start: float, active: bool, nominal: np.void
) -> None:
    row = row_with(actuator_fault(RUDDER, 0.5, 0.0, 0.0, 19.0, 22.0))
    rudder = apply_faults(COMMAND, interval_start, interval_start, row, nominal)[2]
    assert (rudder == 0.15) == active


def test_actuators_stop_at_their_stops(nominal: np.void) -> None:
    limit = nominal["stops"][RUDDER, 1]
    row = row_with(actuator_fault(RUDDER, 1.0, 30.0, 0.0, 0.0, NAN))
    assert apply_faults((0.0, 0.0, limit, 0.0), 1.0, 1.0, row, nominal)[2] == limit
    row = row_with(actuator_fault(THROTTLE, 1.0, -500.0, 0.0, 0.0, NAN))
    assert applied(row, 1.0, nominal)[3] == 0.0

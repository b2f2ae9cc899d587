"""Outputs of PX4 as commands of the plant's actuators."""

import numpy as np
import pytest
from pydantic import ValidationError

from mavlink_defs.dialect import MAV_MODE_FLAG_SAFETY_ARMED
from mavlink_defs.framing.codec import ACTUATORS
from sitl_plant.airframe.aerodynamics import aerodynamics, moment
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.foreign.px4.config import MotorOutput, Px4Outputs, ServoOutput
from sitl_plant.foreign.px4.outputs import Px4Actuators

RUDDER, MOTOR, LEFT, RIGHT, ELEVATOR = 3, 5, 6, 7, 8  # of PX4's plane


@pytest.fixture
def aircraft(scenario1):
    return scenario1.aircraft


def received(aircraft, values, armed=True, **config):
    actuators = Px4Actuators(Px4Outputs.model_validate(config), aircraft_record(aircraft))
    message = np.zeros(1, ACTUATORS)[0]
    message["mode"] = 1 | (MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    for output, value in values.items():
        message["controls"][output - 1] = value
    actuators.receive(message)
    return actuators.shares.tolist()


def test_outputs_in_the_middle_command_nothing(aircraft):
    assert received(aircraft, {}) == [0.0, 0.0, 0.0, 0.0]


def test_one_that_is_not_armed_commands_nothing_whatever_it_says(aircraft):
    values = dict.fromkeys(range(1, 17), 0.7)
    assert received(aircraft, values, armed=False) == [0.0, 0.0, 0.0, 0.0]
    assert 0.0 not in received(aircraft, values | {LEFT: -0.7})


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("values", "axis"),
    [({LEFT: -0.4, RIGHT: 0.4}, 0), ({ELEVATOR: 0.4}, 1), ({RUDDER: 0.4}, 2)],
)
def test_a_greater_value_turns_right_or_the_nose_up(aircraft, values, axis, swapped):
    """As CA_SV_CS*_TRQ_* of PX4's plane have it, whatever the signs of our coefficients."""
    if swapped:
        names = ("cl_da", "cl_dr", "cm_de", "cn_da", "cn_dr")
        flipped = {name: -getattr(aircraft.coefficients, name) for name in names}
        coefficients = aircraft.coefficients.model_copy(update=flipped)
        aircraft = aircraft.model_copy(update={"coefficients": coefficients})
    shares = received(aircraft, values)
    air = aerodynamics((45.0, 0.0, 2.0), (0.0, 0.0, 0.0), aircraft_record(aircraft))
    limit = np.radians(aircraft.surface_limit_deg)
    with_it = moment(air, tuple(limit * share for share in shares[:3]))
    without = moment(air, (0.0, 0.0, 0.0))
    assert with_it[axis] - without[axis] > 0.0
    assert max(map(abs, shares)) == pytest.approx(0.4)


def test_two_ailerons_count_by_their_mean(aircraft):
    assert abs(received(aircraft, {LEFT: -0.2, RIGHT: 0.6})[0]) == pytest.approx(0.4)
    assert received(aircraft, {LEFT: 0.5, RIGHT: 0.5})[0] == 0.0, "both up: flaps, no roll"


def test_elevons_are_outputs_of_two_surfaces(aircraft):
    elevons = {
        "aileron": [{"output": 1, "reversed": True}, {"output": 2}],
        "elevator": [{"output": 1}, {"output": 2}],
        "rudder": [],
    }
    aileron, elevator, rudder, _ = np.abs(received(aircraft, {1: 0.1, 2: 0.5}, **elevons))
    assert (aileron, elevator, rudder) == pytest.approx((0.2, 0.3, 0.0))


def test_each_side_of_the_middle_counts_by_that_side(aircraft):
    rudder = [{"output": RUDDER, "least": -0.5, "middle": 0.1, "greatest": 0.3}]
    for value, share in ((0.2, 0.5), (-0.2, 0.5), (-1.0, 1.0), (1.0, 1.0), (0.1, 0.0)):
        got = received(aircraft, {RUDDER: value}, rudder=rudder)[2]
        assert abs(got) == pytest.approx(share, abs=1e-6), value


@pytest.mark.parametrize(("value", "share"), [(0.0, 0.0), (0.4, 0.4), (1.0, 1.0), (-1.0, 0.0)])
def test_the_motor_is_a_share_of_the_thrust(aircraft, value, share):
    assert received(aircraft, {MOTOR: value})[3] == pytest.approx(share)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_no_value_makes_a_command_out_of_range(aircraft, value):
    with np.errstate(over="ignore"):
        shares = received(aircraft, dict.fromkeys(range(1, 17), value))
    assert np.isfinite(shares).all()
    assert max(map(abs, shares)) <= 1.0


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Px4Outputs(throttle=MotorOutput(output=8)), "another one than the throttle's"),
        (lambda: MotorOutput(off=0.5, full=0.5), "expected > off = 0.5, got 0.5"),
        (lambda: ServoOutput(output=1, middle=1.0), "between least = -1 and greatest = 1"),
        (lambda: ServoOutput(output=17), "17"),
    ],
)
def test_a_mistake_is_named(make, text):
    with pytest.raises(ValidationError, match=text):
        make()

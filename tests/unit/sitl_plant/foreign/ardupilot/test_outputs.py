"""Pulses of ArduPilot as commands of the plant's actuators."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sitl_plant.airframe.aerodynamics import aerodynamics, moment
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.foreign.ardupilot.config import ArduPilot, SurfaceOutput
from sitl_plant.foreign.ardupilot.outputs import Outputs, surface_share

AILERON, THROTTLE = 0, 3
MIDDLE = (1500, 1500, 1000, 1500, *[1500] * 12)


@pytest.fixture
def aircraft(scenario1):
    return scenario1.aircraft


def received(aircraft, *pulses, **config):
    outputs = Outputs(ArduPilot.model_validate(config), aircraft_record(aircraft))
    outputs.receive((*pulses, *MIDDLE[len(pulses) :]))
    return outputs.shares.tolist()


def test_pulses_in_the_middle_and_none_of_thrust_command_nothing(aircraft):
    assert received(aircraft, *MIDDLE) == [0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("channel", "axis"), [(0, 0), (1, 1), (3, 2)])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_longer_pulse_turns_right_or_the_nose_up(aircraft, channel, axis, swapped):
    """As ArduPilot's own model of a plane has it, whatever the signs of our coefficients."""
    if swapped:
        flipped = {
            name: -getattr(aircraft.coefficients, name)
            for name in ("cl_da", "cl_dr", "cm_de", "cn_da", "cn_dr")
        }
        coefficients = aircraft.coefficients.model_copy(update=flipped)
        aircraft = aircraft.model_copy(update={"coefficients": coefficients})
    record = aircraft_record(aircraft)
    pulses = list(MIDDLE)
    pulses[channel] = 1700
    shares = received(aircraft, *pulses)
    air = aerodynamics((45.0, 0.0, 2.0), (0.0, 0.0, 0.0), record)
    limit = np.radians(aircraft.surface_limit_deg)
    with_it = moment(air, tuple(limit * share for share in shares[:3]))
    without = moment(air, (0.0, 0.0, 0.0))
    assert with_it[axis] - without[axis] > 0.0
    assert max(map(abs, shares)) == pytest.approx(0.4)


def test_channels_are_aileron_elevator_throttle_rudder(aircraft):
    shares = received(aircraft, 1000, 1250, 1600, 2000)
    assert np.abs(shares) == pytest.approx([1.0, 0.5, 1.0, 0.6])
    others = received(aircraft, 1000, 1250, 1600, 2000, *[1900] * 12)
    assert others == shares, "outputs that move nothing are none of the plant's"


def test_channels_are_chosen_and_reversed(aircraft):
    config = {
        "aileron": {"channel": 20, "reversed": True},
        "throttle": {"channel": 1, "min_us": 1100, "max_us": 1900},
    }
    outputs = Outputs(ArduPilot.model_validate(config), aircraft_record(aircraft))
    pulses = [1500] * 32
    pulses[19] = 1750
    outputs.receive(tuple(pulses))
    plain = received(aircraft, 1750)
    assert outputs.shares[AILERON] == -plain[AILERON]
    assert outputs.shares[THROTTLE] == 0.5


def test_a_surface_without_pulses_stays_and_an_engine_stops(aircraft):
    outputs = Outputs(ArduPilot(), aircraft_record(aircraft))
    outputs.receive((1600, 1450, 1500, 1700, *MIDDLE[4:]))
    before = outputs.shares.copy()
    outputs.receive((0,) * 16)
    assert outputs.shares[:3].tolist() == before[:3].tolist()
    assert outputs.shares[THROTTLE] == 0.0


@given(st.floats(0, 65535), st.booleans())
def test_a_share_is_within_the_stops_and_grows_with_the_pulse(pulse_us, swapped):
    surface = SurfaceOutput(channel=1, min_us=900, trim_us=1400, max_us=2100, reversed=swapped)
    share = surface_share(pulse_us, surface)
    assert -1.0 <= share <= 1.0
    ends = [surface_share(pulse, surface) for pulse in (900, 1400, 2100)]
    assert ends == ([1.0, 0.0, -1.0] if swapped else [-1.0, 0.0, 1.0])
    longer = surface_share(pulse_us + 100.0, surface)
    assert longer <= share if swapped else longer >= share


@pytest.mark.parametrize(
    ("config", "text"),
    [
        ({"aileron": {"channel": 2}}, "channel"),
        ({"aileron": {"channel": 33}}, "channel"),
        ({"rudder": {"channel": 4, "trim_us": 2000}}, "between min_us = 1000"),
        ({"throttle": {"min_us": 2000}}, "min_us = 2000"),
        ({"launch_acceleration_m_s2": 0}, "launch_acceleration"),
    ],
)
def test_what_cannot_be_is_refused(config, text):
    with pytest.raises(ValidationError) as problem:
        ArduPilot.model_validate(config)
    assert text in str(problem.value)

"""Keys of sensor faults: what they mean, and what is wrong with them."""

import math
from typing import Any

import pytest
from pydantic import ValidationError

from mavlink_defs import dialect
from mavlink_defs.config.files import problems_of
from mavlink_defs.sensor_fault_kinds import (
    FAILURES,
    SENSOR_FAULT_KINDS,
    SENSOR_NAMES,
    SENSOR_UNITS,
)
from mavlink_defs.sensor_fault_spec import SensorFaultSpec
from mavlink_defs.sensor_faults import SensorFault, sensor_fault_from_params

NAN = math.nan


def fault(**keys: Any) -> SensorFault:
    return SensorFaultSpec.model_validate(keys).command()


def problems(**keys: Any) -> list[str]:
    with pytest.raises(ValidationError) as caught:
        SensorFaultSpec.model_validate(keys)
    return [str(problem) for problem in problems_of(SensorFaultSpec, caught.value)]


def test_names_and_numbers_are_those_of_the_dialect() -> None:
    for number, name in enumerate(SENSOR_NAMES, 1):
        assert getattr(dialect, f"FTC_SENSOR_{name.upper()}") == number
    for number, failure in enumerate(FAILURES, 1):
        assert getattr(dialect, f"FAILURE_TYPE_{failure.upper()}") == number
    for kind in SENSOR_FAULT_KINDS.values():
        assert getattr(dialect, f"FTC_SENSOR_FAULT_KIND_{kind.name.upper()}") == kind.code
        assert kind.failure in {kind.name, "wrong"}


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"sensor": "airspeed", "failure": "stuck"}, "airspeed stuck from now, until cleared"),
        ({"sensor": "airspeed", "failure": "wrong"}, "airspeed times 0.5 from now, until cleared"),
        (
            {"sensor": "gyro", "instance": 2, "bias_deg_s": -3, "axis": "z", "start_s": 1},
            "gyro 2 z -3 deg/s after 1 s, until cleared",
        ),
        (
            {"sensor": "accelerometer", "failure": "slow", "start_s": 1.0, "end_s": 2.0},
            "accelerometer slow, 1 sample in 10 in (1, 2] s",
        ),
        (
            {"sensor": "gps", "drift_m_s": 2.5, "end_s": 9.0},
            "gps drifts by +2.5 m/s from now to 9 s",
        ),
        (
            {"sensor": "gps", "failure": "wrong", "drift_m_s": 2.5},
            "gps drifts by +2.5 m/s from now, until cleared",
        ),
    ],
)
def test_keys_make_a_fault_and_a_text(keys: dict[str, Any], text: str) -> None:
    assert fault(**keys).describe() == text


@pytest.mark.parametrize("sensor", SENSOR_UNITS)
@pytest.mark.parametrize("failure", FAILURES)
def test_every_failure_has_a_default_that_the_plant_accepts(sensor: str, failure: str) -> None:
    made = fault(sensor=sensor, failure=failure)
    assert repr(sensor_fault_from_params(made)) == repr(made)
    assert made.kind.failure == failure
    assert made.as_dict(None)["failure"] == failure


@pytest.mark.parametrize("sensor", SENSOR_UNITS)
def test_plain_data_are_the_keys_that_make_the_fault(sensor: str) -> None:
    unit = SENSOR_UNITS[sensor]
    for kind in SENSOR_FAULT_KINDS.values():
        if not kind.fits(unit):
            continue
        keys = {kind.key(unit): 1.0} if kind.has_value else {"failure": kind.failure}
        made = fault(sensor=sensor, instance=1, start_s=2.0, end_s=3.0, **keys)
        again = made.as_dict(None)
        del again["active"]
        assert fault(**again) == made


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"sensor": "gyro"}, "expected a 'failure' or a value, got neither"),
        (
            {"sensor": "gyro", "bias_pa": 1.0},
            "bias_pa: does not fit a sensor of gyro; did you mean 'bias_deg_s'?",
        ),
        ({"sensor": "gps", "scale": 2.0}, "scale: does not fit a sensor of gps"),
        (
            {"sensor": "gyro", "failure": "slow", "bias_deg_s": 1.0},
            "bias_deg_s: does not go with a failure 'slow'; it is one of 'wrong'",
        ),
        (
            {"sensor": "gyro", "bias_deg_s": 1.0, "noise_factor": 2.0},
            "noise_factor: cannot be combined with 'bias_deg_s'",
        ),
        (
            {"sensor": "airspeed", "bias_pa": 2e4},
            "bias_pa: expected [-10000, 10000] Pa, got 20000.0",
        ),
        ({"sensor": "gyro", "delayed_s": 1.5}, "delayed_s: expected [0, 1] s, got 1.5"),
        (
            {"sensor": "gps", "failure": "off", "instance": 2},
            "instance: expected 0 or 1, as there is one sensor of gps, got 2",
        ),
        (
            {"sensor": "gyro", "failure": "off", "axis": "x"},
            "axis: expected none, as off concerns all axes, got 'x'",
        ),
        (
            {"sensor": "barometer", "bias_pa": 1.0, "axis": "x"},
            "axis: expected none, as barometer has no axes, got 'x'",
        ),
        (
            {"sensor": "gyro", "failure": "off", "start_s": 3.0, "end_s": 2.0},
            "end_s: expected > start_s = 3.0 s, got 2.0",
        ),
        (
            {"sensor": "pitot", "failure": "off"},
            "sensor: expected 'gyro', 'accelerometer', 'magnetometer', 'barometer', 'gps' or "
            "'airspeed', got 'pitot'",
        ),
    ],
)
def test_what_is_wrong_is_said(keys: dict[str, Any], problem: str) -> None:
    assert problems(**keys) == [problem]

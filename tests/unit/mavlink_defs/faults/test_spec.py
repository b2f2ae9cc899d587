"""Keys of faults: what they mean, and what is wrong with them."""

from typing import Any

import pytest
from pydantic import ValidationError

from mavlink_defs import dialect
from mavlink_defs.config.files import problems_of
from mavlink_defs.faults import FAMILIES, FAMILY_OF
from mavlink_defs.faults.command import fault_from_params
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import AXIS_NAMES, FAILURES, SENSOR_FAULTS
from mavlink_defs.faults.spec import SPECS, FaultSpec


def spec(keys: dict[str, Any]) -> type[FaultSpec]:
    return SPECS["sensor" if "sensor" in keys else "actuator"]


def fault(**keys: Any) -> Fault:
    return spec(keys).model_validate(keys).command()


def problems(**keys: Any) -> list[str]:
    with pytest.raises(ValidationError) as caught:
        spec(keys).model_validate(keys)
    named = {"bias_deg": "--bias", "stuck_deg": "--stuck", "start_s": "--start"}
    return [problem.line(named) for problem in problems_of(spec(keys), caught.value)]


def test_names_and_numbers_are_those_of_the_dialect() -> None:
    for family in FAMILIES:
        for target in family.targets:
            name = f"FTC_{family.key}_{target.name}".upper()
            assert getattr(dialect, name) == family.number_of(target)
    for names, of in ((FAILURES, "FAILURE_TYPE"), (AXIS_NAMES, "FTC_AXIS")):
        for number, name in enumerate(names, 1):
            assert getattr(dialect, f"{of}_{name.upper()}") == number
    for kind in SENSOR_FAULTS.kinds:
        assert getattr(dialect, f"FTC_SENSOR_FAULT_KIND_{kind.name.upper()}") == kind.code
        assert kind.failure in {kind.name, "wrong"}


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (
            {"actuator": "rudder", "bias_deg": 2.0},
            "rudder at 100 % + 2 deg from now, until cleared",
        ),
        (
            {"actuator": "throttle", "stuck_n": 2.0, "end_s": 3.0},
            "throttle stuck at 2 N from now to 3 s",
        ),
        (
            {"actuator": "throttle", "effectiveness": 0.0},
            "throttle stuck at 0 N from now, until cleared",
        ),
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


@pytest.mark.parametrize("sensor", [target.name for target in SENSOR_FAULTS.targets])
@pytest.mark.parametrize("failure", FAILURES)
def test_every_failure_has_a_default_that_the_plant_accepts(sensor: str, failure: str) -> None:
    made = fault(sensor=sensor, failure=failure)
    assert repr(fault_from_params(SENSOR_FAULTS, made.params)) == repr(made)
    assert made.kind.failure == failure
    assert made.as_dict(None)["failure"] == failure


@pytest.mark.parametrize("name", FAMILY_OF)
def test_plain_data_are_the_keys_that_make_the_fault(name: str) -> None:
    family = FAMILY_OF[name]
    target = family.named(name)
    for kind in family.kinds_of(target).values():
        keys = {kind.key(target): 1.0} if kind.has_value else {"failure": kind.failure}
        own = {key: 1 for key in ("instance", "frequency_hz") if family.has(key)}
        made = fault(**{family.key: name}, start_s=2.0, end_s=3.0, **keys, **own)
        again = made.as_dict(None)
        del again["active"]
        assert fault(**again) == made


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        (
            {"actuator": "rudder", "bias_deg": 1.0, "stuck_deg": 1.0},
            "--bias: cannot be combined with '--stuck'",
        ),
        (
            {"actuator": "rudder"},
            "expected 'effectiveness', '--bias', '--stuck', 'drift_deg_s', 'hardover_deg' or"
            " 'intermittent_deg', got none of them",
        ),
        (
            {"actuator": "rudder", "bias_n": 1.0},
            "bias_n: does not fit the rudder; did you mean '--bias'?",
        ),
        (
            {"actuator": "rudder", "bias_deg": 1.0, "start_s": 3.0, "end_s": 2.0},
            "end_s: expected > --start = 3.0 s, got 2.0",
        ),
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
            "end_s: expected > --start = 3.0 s, got 2.0",
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

"""Commands that set faults, and faults as texts."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, over_the_wire
from plain_faults import actuator_fault

from mavlink_defs.dialect import MAVLink_command_long_message
from mavlink_defs.faults import FAMILIES
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.command import InvalidParam, fault_from_params
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import Family, FaultLimits
from mavlink_defs.faults.sensors import AXIS_NAMES
from mavlink_defs.faults.window import Window
from mavlink_defs.services.command import command_params

LIMITS = FaultLimits(surfaces_deg=((-25.0, 25.0),) * 3, thrust_n=4000.0)
NAN, INF = math.nan, math.inf


def decimals(low: float, high: float, places: int) -> st.SearchStrategy[float]:
    scale = 10**places
    return st.integers(round(low * scale), round(high * scale)).map(lambda n: n / scale)


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    family = draw(st.sampled_from(FAMILIES))
    target = draw(st.sampled_from(family.targets))
    kind = draw(st.sampled_from(list(family.kinds_of(target).values())))
    start = draw(st.just(NAN) | decimals(0.0, 500.0, 2))
    earliest = 0.0 if math.isnan(start) else start
    value = draw(decimals(*kind.bounds(target, LIMITS), 2)) if kind.has_value else 0.0
    end = draw(st.just(NAN) | decimals(earliest + 0.01, 1000.0, 2))
    own: dict[str, Any] = {}
    if family.has("effectiveness"):
        own["effectiveness"] = draw(decimals(0.0001, 1.0, 4)) if kind.partial else 0.0
        own["frequency_hz"] = draw(decimals(0.01 if kind.switches else 0.0, 500.0, 2))
    if family.has("instance"):
        own["instance"] = draw(st.integers(0, 8))
        axes = len(AXIS_NAMES) if target.axes and kind.wrongs else 0
        own["axis"] = draw(st.integers(0, axes))
    return Fault(target, kind, value, start, end, **own)


@given(faults())
def test_fault_crosses_the_wire_unchanged(fault: Fault) -> None:
    message = MAVLink_command_long_message(1, 1, fault.family.command, 0, *fault.params)
    received: Any = over_the_wire(message, GCS)
    assert repr(fault_from_params(fault.family, command_params(received), LIMITS)) == repr(fault)
    listed: Any = over_the_wire(fault.resolved(0.0).message(0.0), GCS)
    assert Fault.from_message(listed) == fault.resolved(0.0)


@given(st.sampled_from(FAMILIES), st.lists(st.floats(width=32), min_size=7, max_size=7))
def test_any_parameters_give_a_fault_within_limits_or_are_refused(
    family: Family, params: list[float]
) -> None:
    try:
        fault = fault_from_params(family, params, LIMITS)
    except InvalidParam:
        return
    assert fault.family is family
    assert 0.0 <= fault.effectiveness <= 1.0
    low, high = fault.kind.bounds(fault.target, LIMITS)
    assert not fault.kind.has_value or low <= fault.value <= high


@pytest.mark.parametrize(
    ("params", "index", "text"),
    [
        ((4, 1, 0, 0, 0, NAN, 0), 1, "Fault: Actuator is 4, must be 0, 1, 2 or 3"),
        ((-1, 1, 0, 0, 0, NAN, 0), 1, "Fault: Actuator is -1, must be 0, 1, 2 or 3"),
        ((0.5, 1, 0, 0, 0, NAN, 0), 1, "Fault: Actuator is 0.5, must be 0, 1, 2 or 3"),
        ((NAN, 1, 0, 0, 0, NAN, 0), 1, "Fault: Actuator is nan, must be 0, 1, 2 or 3"),
        ((0, 1.1, 0, 0, 0, NAN, 0), 2, "Fault: Effectiveness is 1.1, must be 0 to 1"),
        ((0, -0.1, 0, 0, 0, NAN, 0), 2, "Fault: Effectiveness is -0.1, must be 0 to 1"),
        ((0, NAN, 0, 0, 0, NAN, 0), 2, "Fault: Effectiveness is nan, must be 0 to 1"),
        ((2, 1, 25.1, 0, 0, NAN, 0), 3, "Fault: Value is 25.1 deg, must be -25 to 25 deg"),
        ((2, 0, -26, 0, 0, NAN, 0), 3, "Fault: Value is -26 deg, must be -25 to 25 deg"),
        ((3, 1, -4001, 0, 0, NAN, 0), 3, "Fault: Value is -4001 N, must be -4000 to 4000 N"),
        ((3, 0, -1, 0, 0, NAN, 0), 3, "Fault: Value is -1 N, must be 0 to 4000 N"),
        ((3, 0, NAN, 0, 0, NAN, 0), 3, "Fault: Value is nan N, must be 0 to 4000 N"),
        ((0, 1, 1, 501, 0, NAN, 0), 4, "Fault: Frequency is 501 Hz, must be 0 to 500 Hz"),
        ((0, 1, 1, -1, 0, NAN, 0), 4, "Fault: Frequency is -1 Hz, must be 0 to 500 Hz"),
        ((0, 1, 1, INF, 0, NAN, 0), 4, "Fault: Frequency is inf Hz, must be 0 to 500 Hz"),
        ((0, 1, 1, 0, -1, NAN, 0), 5, "Fault: Start is -1 s, must be NaN or at least 0 s"),
        ((0, 1, 1, 0, INF, NAN, 0), 5, "Fault: Start is inf s, must be NaN or at least 0 s"),
        ((0, 1, 1, 0, 5, 5, 0), 6, "Fault: End is 5 s, must be NaN or more than 5 s"),
        ((0, 1, 1, 0, NAN, 0, 0), 6, "Fault: End is 0 s, must be NaN or more than 0 s"),
        ((0, 1, 1, 0, NAN, NAN, 200), 7, "Fault: Kind is 200, must be 0 or 1 or 2 or 3"),
        ((0, 0.5, 9, 0, 0, NAN, 2), 2, "Fault: Effectiveness is 0.5, must be 0"),
        ((0, 1, 1, 0, 0, NAN, 3), 4, "Fault: Frequency is 0 Hz, must be more than 0 Hz"),
        ((0, 0.5, 26, 0, 0, NAN, 1), 3, "Fault: Value is 26 deg/s, must be -25 to 25 deg/s"),
    ],
)
def test_bad_parameter_is_named(params: tuple[float, ...], index: int, text: str) -> None:
    with pytest.raises(InvalidParam) as caught:
        fault_from_params(ACTUATOR_FAULTS, params, LIMITS)
    assert caught.value.index == index
    assert str(caught.value) == caught.value.text == text


def test_limit_that_went_through_radians_does_not_refuse_itself() -> None:
    for degrees in range(1, 90):
        stop = math.degrees(math.radians(degrees))
        limits = FaultLimits(((-stop, stop),) * 3, 1.0)
        fault = fault_from_params(ACTUATOR_FAULTS, (0, 1, float(degrees), 0, NAN, NAN, 0), limits)
        assert fault.value == degrees


def test_negative_thrust_bias_is_a_fault() -> None:
    fault = fault_from_params(ACTUATOR_FAULTS, (3, 1, -4000, 0, NAN, INF, 0), LIMITS)
    assert (fault.value, fault.end_s) == (-4000.0, INF)


def test_a_kind_that_is_not_given_is_the_first() -> None:
    assert fault_from_params(ACTUATOR_FAULTS, (2, 1, 5, 0, NAN, NAN, NAN), LIMITS).code == 0


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (
            actuator_fault(0, 1.0, -2.0, 0.3, 1.0, math.inf),
            "aileron at 100 % - 2 deg · cos 2π 0.3 Hz after 1 s, until cleared",
        ),
        (
            actuator_fault(3, 0.0, 1.5, 0.0, math.nan, math.nan),
            "throttle stuck at 1.5 N from now, until cleared",
        ),
        (actuator_fault(1, 0.0, -3.0, 0.0, 1.0, 2.0), "elevator stuck at -3 deg in (1, 2] s"),
        (
            actuator_fault(2, 0.5, 1.0, 0.0, math.nan, 22.0),
            "rudder at 50 % + 1 deg from now to 22 s",
        ),
    ],
)
def test_faults_as_texts(fault: Fault, expected: str) -> None:
    assert fault.describe() == expected


@pytest.mark.parametrize("end_s", [math.nan, math.inf, 9.5])
@pytest.mark.parametrize("start_s", [math.nan, math.inf, -math.inf, 0.0, 2.5])
def test_a_window_is_told_in_whole_words(start_s: float, end_s: float) -> None:
    text = str(Window(start_s, end_s))
    both = math.isfinite(start_s) and math.isfinite(end_s)
    begin = f"after {start_s:g} s" if math.isfinite(start_s) else "from now"
    end = f" to {end_s:g} s" if math.isfinite(end_s) else ", until cleared"
    assert text == (f"in ({start_s:g}, {end_s:g}] s" if both else begin + end)

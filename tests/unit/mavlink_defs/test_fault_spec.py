import math
from typing import Any

import pytest
from pydantic import ValidationError

from mavlink_defs.config.files import problems_of
from mavlink_defs.fault_spec import FaultSpec
from mavlink_defs.faults import Fault

NAN = math.nan


def problems(**keys: Any) -> list[str]:
    with pytest.raises(ValidationError) as caught:
        FaultSpec.model_validate(keys)
    named = {"bias_deg": "--bias", "stuck_deg": "--stuck", "start_s": "--start"}
    return [problem.line(named) for problem in problems_of(FaultSpec, caught.value)]


def test_an_open_window_begins_now_and_lasts() -> None:
    fault = FaultSpec.model_validate({"actuator": "rudder", "bias_deg": 2.0}).command()
    assert repr(fault) == repr(Fault(2, 1.0, 2.0, 0.0, NAN, NAN))


def test_an_end_needs_no_start() -> None:
    keys = {"actuator": "throttle", "stuck_n": 2.0, "end_s": 3.0}
    fault = FaultSpec.model_validate(keys).command()
    assert repr(fault) == repr(Fault(3, 0.0, 2.0, 0.0, NAN, 3.0))


def test_keys_are_reported_under_other_names() -> None:
    assert problems(actuator="rudder", bias_deg=1.0, stuck_deg=1.0) == [
        "--bias: cannot be combined with '--stuck'"
    ]
    assert problems(actuator="rudder") == [
        "expected 'effectiveness', '--bias', '--stuck', 'drift_deg_s', 'hardover_deg' or"
        " 'intermittent_deg', got none of them"
    ]
    assert problems(actuator="rudder", bias_n=1.0) == [
        "bias_n: does not fit the rudder; did you mean '--bias'?"
    ]
    assert problems(actuator="rudder", bias_deg=1.0, start_s=3.0, end_s=2.0) == [
        "end_s: expected > --start = 3.0 s, got 2.0"
    ]

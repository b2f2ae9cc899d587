"""A weak aileron under steps of heading: roll is held as PID holds it, and heading waits.

The rival is the PID law on the same flight. Without slower turns roll is three times as far off.
"""

import functools
from typing import Any

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

PROFILE = [
    {"start_s": 0.0, "airspeed_m_s": 45.0, "roll_deg": 0.0, "pitch_deg": 2.0, "yaw_deg": 0.0},
    {"start_s": 6.0, "airspeed_m_s": 45.0, "roll_deg": 0.0, "pitch_deg": 2.0, "yaw_deg": 22.0},
    {"start_s": 11.0, "airspeed_m_s": 40.0, "roll_deg": 5.0, "pitch_deg": 3.0, "yaw_deg": -8.0},
]


@functools.cache
def largest_error_deg(law: str, effectiveness: float) -> float:
    """Return the largest error of roll or pitch [deg] after the aileron has become weak."""
    tree = merged(scenario_tree("paper/scenario1"), scenario_tree("realistic"))
    fault = {"uav": 1, "actuator": "aileron", "effectiveness": effectiveness, "start_s": 3.0}
    own: dict[str, Any] = {"duration_s": 16.0, "controller": {"kind": law}, "faults": [fault]}
    flight = fly_in_process(scenario_of("it", merged(tree, own | {"profile": PROFILE})))
    late = flight.time_s > 3.0
    return float(np.degrees(np.abs(flight.error("reference")[late, 0, 1:3])).max())


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("effectiveness", [0.16, 0.24, 0.35])
def test_roll_and_pitch_are_hardly_worse_than_with_pid(law: str, effectiveness: float) -> None:
    by_pid = largest_error_deg("pid", effectiveness)
    assert largest_error_deg(law, effectiveness) < 1.5 * by_pid + 3.0

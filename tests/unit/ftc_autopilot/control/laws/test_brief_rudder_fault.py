"""A rudder that is stuck for a second: the heading is turned back as soon as it moves again.

The rival is the PID law, which sends a stuck rudder to its stop and has nothing to find out.
"""

import functools

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

UAV = 1  # index


@functools.cache
def largest_yaw_error(law: str, stuck_deg: float) -> float:
    """Return the largest yaw error [deg] of a flight in which the rudder is stuck from 8 to 9 s."""
    tree = merged(scenario_tree("paper/scenario1"), scenario_tree("realistic"))
    fault = {"uav": 2, "actuator": "rudder", "stuck_deg": stuck_deg, "start_s": 8.0, "end_s": 9.0}
    own = {"duration_s": 12.0, "controller": {"kind": law}, "faults": [fault]}
    flight = fly_in_process(scenario_of("it", merged(tree, own)))
    return float(np.degrees(np.abs(flight.states[6000:, UAV, 8] - np.radians(10.0))).max())


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("stuck_deg", [-25.0, -10.9, 0.0, 10.0])
def test_it_turns_no_further_away_than_with_pid(law: str, stuck_deg: float) -> None:
    assert largest_yaw_error(law, stuck_deg) < 1.04 * largest_yaw_error("pid", stuck_deg)

"""Actuator commands that are put in force: whole datagrams of values that can be commands."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.framing.codec import ACTUATORS
from sitl_plant.loop.fleet import new_plant_state, receive_controls

command = st.floats(-1.0, 1.0, width=32) | st.floats(width=32)


@given(
    st.lists(
        st.tuples(command, command, st.sampled_from([0.0, 0.5]), command), min_size=1, max_size=4
    )
)
def test_what_is_no_command_leaves_all_channels_as_they_were(
    scenario1: Scenario, received: list[tuple[float, float, float, float]]
) -> None:
    fleet = new_plant_state(scenario1.plant_config())
    aircraft = fleet.uavs[0]["aircraft"]
    limits = np.array([*aircraft["stops"][:, 1], aircraft["thrust_limit"]])
    for step, controls in enumerate(received, 1):
        fleet.uavs[0]["message"]["time_usec"] = 1000 * step
        message = np.zeros(1, ACTUATORS)[0]
        message["time_usec"] = 1000 * step
        message["controls"][:N_CHANNELS] = controls
        before = fleet.uavs[0]["controls"].copy()
        problem = receive_controls(fleet, 0, message)
        sent = np.array(controls, np.float32)
        valid = bool((np.abs(sent) <= 1.0).all() and sent[THROTTLE] >= 0.0)
        assert (problem == 0) == valid
        expected = sent.astype(float) * limits if valid else before
        assert np.array_equal(fleet.uavs[0]["controls"], expected)

"""The launch: consistent motion from rest to the initial state, by differences in time."""

import numpy as np
import pytest
from json_peer import into_earth

from sitl_plant.foreign.ardupilot.launch import new_launch

STATE = np.array([10.0, -20.0, -300.0, 40.0, 3.0, 4.0, 0.2, 0.3, -2.0, 0.0, 0.0, 0.0])
AIR = np.array([-3.0, 1.0, 0.5])
GRAVITY, DURATION_S = 9.80665, 2.5


@pytest.fixture
def launch():
    return new_launch(STATE, AIR, GRAVITY, DURATION_S)


def test_it_is_held_at_rest_until_it_begins(launch):
    held = [launch.at(t, time_s) for t, time_s in ((-3.0, 0.0), (-1e-3, 2.0))]
    assert [one.time_s for one in held] == [0.0, 2.0]
    assert held[0]._replace(time_s=2.0) == held[1]
    assert held[0].velocity == (0.0, 0.0, 0.0)
    assert held[0].rates == (0.0, 0.0, 0.0)
    support = into_earth(held[0].specific_force, held[0].attitude)
    assert support == pytest.approx([0.0, 0.0, -GRAVITY])
    assert held[0].airspeed == pytest.approx(np.linalg.norm(AIR))


def test_it_ends_in_the_initial_state(launch):
    end = launch.at(DURATION_S, 9.0)
    assert end.position == pytest.approx(tuple(STATE[:3]))
    assert end.velocity == pytest.approx(into_earth(STATE[3:6], STATE[6:9]))
    assert end.attitude == tuple(STATE[6:9])
    assert end.airspeed == pytest.approx(np.linalg.norm(STATE[3:6] - AIR))
    assert end.wind == pytest.approx(into_earth(AIR, STATE[6:9]))


@pytest.mark.parametrize("t", [0.001, 0.7, 2.4])
def test_position_velocity_and_accelerometer_agree(launch, t):
    h = 1e-5
    before, now, after = (launch.at(t + d, 0.0) for d in (-h, 0.0, h))
    speed = (np.array(after.position) - before.position) / (2 * h)
    assert speed == pytest.approx(np.array(now.velocity), abs=1e-5)
    acceleration = (np.array(after.velocity) - before.velocity) / (2 * h)
    felt = np.add(into_earth(now.specific_force, now.attitude), [0.0, 0.0, GRAVITY])
    assert felt == pytest.approx(acceleration, abs=1e-6)


def test_no_position_jumps_where_it_begins(launch):
    assert launch.at(0.0, 0.0).position == launch.at(-1.0, 0.0).position

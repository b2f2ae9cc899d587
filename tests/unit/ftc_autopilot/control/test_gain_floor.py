"""A floor under the gain of the paper's attitude law, for aircraft that hardly need a moment."""

import numpy as np
import pytest

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged


def largest_errors(*additions: str) -> np.ndarray:
    """Return the largest errors of roll, pitch, yaw of three Aerosondes from 3 s on [deg]."""
    tree = scenario_tree("airframes/aerosonde") | {"controller": {"kind": "proposed"}}
    tree.pop("trigger", None)
    for addition in additions:
        tree = merged(tree, scenario_tree(addition))
    flight = fly_in_process(scenario_of("aerosonde", tree))
    assert flight.loss is None
    errors: np.ndarray = np.degrees(np.abs(flight.error("reference")[3000:, :, 1:])).max((0, 1))
    return errors


def test_the_papers_law_swings_on_servos_of_a_trimmed_aircraft_and_a_floor_stops_that() -> None:
    assert np.all(largest_errors("realistic") > 5.0)
    assert np.all(largest_errors("realistic", "gain_floor") < 0.6)


@pytest.mark.parametrize("floor", [0.0, 0.003])
def test_a_floor_below_the_gain_changes_nothing(floor: float) -> None:
    """On the paper's aircraft the gain is above it all the time."""
    tree = scenario_tree("paper/scenario1") | {"duration_s": 3.0, "faults": []}
    as_printed = fly_in_process(scenario_of("one", tree))
    changed = merged(tree, {"controller": {"gain_floor": floor}})
    floored = fly_in_process(scenario_of("one", changed))
    assert np.array_equal(as_printed.states, floored.states)


def test_a_floor_above_the_gain_changes_the_flight() -> None:
    tree = scenario_tree("paper/scenario1") | {"duration_s": 1.0, "faults": []}
    as_printed = fly_in_process(scenario_of("one", tree))
    changed = merged(tree, {"controller": {"gain_floor": 5.0}})
    floored = fly_in_process(scenario_of("one", changed))
    assert not np.array_equal(as_printed.states, floored.states)

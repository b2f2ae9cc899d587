"""Every law flies over a bad simulator link nearly as over a good one."""

import numpy as np
import pytest

from benchmarks.bad_links import LINKS, fly_over, iae, scenario_with
from ftc_autopilot.control.laws import KINDS
from gcs.fleet.in_process import fly_in_process
from gcs.results.quantities import QUANTITIES
from gcs.results.summary import summarise
from mavlink_defs.capture.impairment import Impairment

DURATION_S = 8.0


@pytest.mark.parametrize("law", KINDS)
def test_losses_and_jitter_cost_a_law_little(law: str) -> None:
    scenario = scenario_with(law, DURATION_S)
    clean = iae(summarise(fly_in_process(scenario), scenario).uavs)
    flight = fly_over(scenario, LINKS["loss 10 %, jitter 5 ms"])
    assert 0.08 < np.mean(flight.missing) < 0.12
    found = iae(summarise(flight, scenario).uavs)
    for name in QUANTITIES:
        assert found[name] < 1.05 * clean[name], name  # without compensation: 1.08 and more


def test_over_a_good_link_the_flight_is_the_same_bit_for_bit() -> None:
    scenario = scenario_with("proposed", 2.0)
    flight, expected = fly_over(scenario, Impairment()), fly_in_process(scenario)
    assert np.array_equal(flight.states, expected.states)
    assert flight.signals.tobytes() == expected.signals.tobytes()
    assert not flight.repeats.any()

"""A restart changes nothing of what is flown, whatever was asked before and is asked after."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from vehicle_bench import Bench
from vehicle_requests import Request, requests, second_process, start_flight, state_of

from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, LOITER
from mavlink_defs.mission_files import mission_item

SET_MODE = dialect.MAV_CMD_DO_SET_MODE


@pytest.fixture(scope="module")
def formation() -> Scenario:
    return load_scenario("scenarios/missions/hexagon.yaml")


def flown(bench: Bench) -> dict[str, Any]:
    """Return what does not only concern stations: their intervals are as at the boot."""
    state = state_of(bench)
    del state["intervals"]
    return state


@settings(
    phases=(Phase.explicit, Phase.generate),  # shrinking takes minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture],  # the file is written again
)
@given(
    st.lists(requests(), min_size=2, max_size=12),
    st.lists(requests(), min_size=1, max_size=4),
    st.booleans(),
)
def test_a_vehicle_flies_on_as_before_its_death(
    scenario1: Scenario,
    formation: Scenario,
    tmp_path: Path,
    asked: list[Request],
    then: list[Request],
    in_formation: bool,
) -> None:
    scenario = formation if in_formation else scenario1
    first = Bench(scenario)
    places = ((-353300000, 1491652370), (-353300000, 1492000000), (-353500000, 1492000000))
    start_flight(first, [mission_item(k, 16, (), *p, 100.0) for k, p in enumerate(places, 1)])
    for request in asked:
        request(first)
    second = second_process(first, scenario, tmp_path)
    assert flown(second) == flown(first)
    for process in (first, second):
        for mode in (LOITER, AUTO):
            process.command(SET_MODE, 1.0, mode)
    assert flown(second) == flown(first)
    for request in then:
        assert request(first) == request(second)
        assert flown(second) == flown(first)

"""A formation takes off from one runway and lands on it, one after the other."""

from pathlib import Path
from typing import Any

import pytest
from scenario_edits import edit

from gcs.fleet.in_process import fly_and_summarise
from gcs.results.figures import FlightSummary
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.models import ConfigError

FORMATION = Path("scenarios/runway/formation.yaml")
LANDING: dict[str, Any] = {
    "uavs": [
        {
            "id": 1 + k,
            "name": f"{k}",
            "initial": {
                "north_m": -250.0 * k,
                "east_m": 0.0,
                "altitude_m": 60.0,
                "airspeed_m_s": 40.0,
            },
        }
        for k in range(3)
    ],
    "formation.slots": {1: {}, 2: {"ahead_m": -250.0}, 3: {"ahead_m": -500.0}},
    "formation.changes": [],
    "runway.north_m": 2250.0,
    "mission.items": [
        {"waypoint": {"north_m": 400.0, "east_m": 0.0, "height_m": 60.0}},
        {"land": {"north_m": 2400.0, "east_m": 0.0}},
    ],
    "faults": [],
    "duration_s": 95.0,
}


def scenario(**changes: Any) -> Scenario:
    tree = edit(scenario_tree(FORMATION), {"step_us": 4000, **changes})
    return scenario_of(FORMATION, tree)


def outcomes(flight: FlightSummary) -> list[str]:
    assert flight.separation is not None
    assert flight.separation.least_m > 20.0
    assert all(uav.ground and (uav.ground.off_centre_m or 0.0) < 7.5 for uav in flight.uavs)
    return [uav.ground.outcome for uav in flight.uavs if uav.ground]


def test_it_takes_off_one_after_the_other() -> None:
    assert outcomes(fly_and_summarise(scenario(duration_s=45.0))) == ["in the air"] * 3


def test_a_rejected_take_off_keeps_those_behind_on_the_ground() -> None:
    fault = {"uav": 1, "actuator": "throttle", "stuck_n": 0.0, "start_s": 5.0}
    flight = fly_and_summarise(scenario(faults=[fault], duration_s=45.0))
    assert outcomes(flight) == ["on the ground"] * 3


def test_it_lands_one_after_the_other() -> None:
    flight = fly_and_summarise(scenario(**LANDING))
    assert outcomes(flight) == ["landed"] * 3
    times = [uav.ground.worst.time_s for uav in flight.uavs if uav.ground and uav.ground.worst]
    assert times == sorted(times)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"formation.changes": []}, "UAVs 1 and 2 fly 30 m apart along the path at the end"),
        ({"runway.length_m": 165.0}, "the runway is 165 m long, 3 landings take 303 m"),
        ({"mission.items.1.waypoint.north_m": 0.0}, "straight to the first place"),
    ],
)
def test_what_cannot_be_flown_is_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        scenario(**changes)

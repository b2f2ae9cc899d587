"""Flights by sensors that fail or are not there: the estimate stays near the truth."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from ftc_autopilot.common.phases import LOST
from gcs.fleet.in_process import begin, fly_in_process, fly_on
from gcs.results.recording import Steps
from gcs.scenario.bundled import bundled_names
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

FAULTS = [name for name in bundled_names() if name.startswith("sensor_faults/")]
SETTLED = 8000  # steps
MAX_DEG = {"sensor_faults/gyro_garbage": 10.0}
"""Largest error of roll and pitch, where it is not 2°."""
MAX_M_S = {"sensor_faults/pitot_iced": 22.0}
"""Largest error of the airspeed, where it is not 5 m/s: of a tube that ices up before the ratio of
its pressure and the lift has been learned."""


def by_sensors(name: str, **changes: Any) -> Scenario:
    own = {"controller": {"kind": "surviving"}, "navigation": "estimated", **changes}
    return scenario_of(name, merged(scenario_tree(name), own))


@pytest.mark.parametrize("name", FAULTS)
def test_estimates_stay_near_the_truth(name: str) -> None:
    flown = estimates_of(by_sensors(name))
    assert flown.attitude_deg < MAX_DEG.get(name, 2.0)
    assert flown.airspeed_m_s < MAX_M_S.get(name, 5.0)
    assert flown.place_m < 90.0  # a minute without GNSS: 8 to 76 m by seed
    assert flown.phase < LOST  # no actuator is blamed for a sensor


@pytest.mark.parametrize(
    "fitted",
    [
        {"grade": "ideal"},
        {"grade": "tactical"},
        {"imus": 1},
        {"imus": 3},
        *({name: {"fitted": False}} for name in ("magnetometer", "barometer", "pitot")),
    ],
)
def test_any_set_that_can_be_observed_is_flown_by(fitted: dict[str, Any]) -> None:
    scenario = by_sensors("paper/scenario1", faults=[], sensors={"navigation": fitted})
    flown = estimates_of(scenario)
    assert flown.attitude_deg < 1.0
    assert flown.airspeed_m_s < 4.0  # without a pitot tube: 1.5 to 3.6 by seed
    assert flown.place_m < 8.0
    assert flown.phase < LOST


class Flown(NamedTuple):
    """Largest errors of the estimate after 8 s, and the worst phase of an actuator."""

    attitude_deg: float
    airspeed_m_s: float
    place_m: float
    phase: int


def estimates_of(scenario: Scenario) -> Flown:
    steps = Steps.room(scenario.steps, len(scenario.uavs), estimated=True)
    assert fly_on(scenario, begin(scenario), steps.part).loss is None
    true, estimated = steps.states[SETTLED:], steps.estimates[SETTLED:]
    angles = np.degrees(np.abs(estimated[..., 6:8] - true[..., 6:8]))
    through = np.linalg.norm(true[..., 3:6] - steps.wind[SETTLED:], axis=-1)
    shown = np.linalg.norm(estimated[..., 3:6] - estimated[..., 12:15], axis=-1)
    place = np.linalg.norm(estimated[..., :3] - true[..., :3], axis=-1)
    phase = int(steps.signals["phase"].max())
    return Flown(angles.max(), np.abs(shown - through).max(), place.max(), phase)


@pytest.mark.parametrize("fault", ["loe_rudder", "stuck_trim_aileron_for_good", "thrust_loss"])
def test_the_diagnosis_of_actuators_finds_the_same_by_sensors(fault: str) -> None:
    found = []
    for navigation in ("true_state", "estimated"):
        scenario = by_sensors(f"faults/{fault}", navigation=navigation, seed=2)
        flight = fly_in_process(scenario)
        assert flight.loss is None
        found.append({(i, c) for _, i, c in np.argwhere(flight.signals["phase"] == LOST)})
    assert found[0] == found[1]

"""The pitot tube of an aircraft whose lift is mostly what vertical gusts make of it.

A vertical gust of 1 m/s changes the lift of an Aerosonde by half: the tube is not to blame.
"""

from typing import Any

import numpy as np
import pytest

from gcs.fleet.in_process import begin, fly_on
from gcs.results.recording import Steps
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import PITOT

pytestmark = pytest.mark.slow

LOOK_S = 0.1


def tube_is_out(
    name: str, turbulence: str, faults: list[dict[str, Any]], duration_s: float, seed: int
) -> np.ndarray:
    """Fly; return whether the tube of each aircraft is excluded, shape (looks, n)."""
    wind: dict[str, Any] = {"turbulence": turbulence, "steady": {"north_m_s": 3.0}}
    own: dict[str, Any] = {"controller": {"kind": "surviving"}, "navigation": "estimated"}
    own |= {"wind": wind, "faults": faults, "duration_s": duration_s, "seed": seed}
    scenario = scenario_of(name, merged(scenario_tree(name), own))
    flight, out = begin(scenario), []
    steps, stride = Steps.room(scenario.steps, 3, estimated=True), round(LOOK_S / 1e-3)
    for first in range(0, scenario.steps, stride):
        part = scenario.model_copy(update={"duration_s": (first + stride) / 1e3})
        assert fly_on(part, flight, steps.part, first=first).loss is None
        out.append(flight.estimates.estimators["report"]["bad_sensors"] >> PITOT & 1)
    return np.array(out).astype(bool)


@pytest.mark.parametrize(
    ("name", "turbulence"),
    [("aerosonde", "moderate"), ("skywalker_x8", "light"), ("c172p", "moderate")],
)
def test_turbulence_is_no_fault_of_the_pitot_tube(name: str, turbulence: str) -> None:
    assert not tube_is_out(f"airframes/{name}", turbulence, [], 30.0, 1).any()


@pytest.mark.parametrize("turbulence", ["none", "light"])
def test_a_tube_that_ices_up_is_found_where_gusts_change_the_lift(turbulence: str) -> None:
    iced = {"uav": 1, "sensor": "airspeed", "start_s": 15.0, "end_s": 60.0, "fade_s": 15.0}
    out = tube_is_out("airframes/aerosonde", turbulence, [iced], 35.0, 4)
    assert not out[: round(15.0 / LOOK_S)].any()
    assert out[round(31.0 / LOOK_S) :, 0].all()
    assert not out[:, 1:].any()

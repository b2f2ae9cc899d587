"""What stations hear of a vehicle's controller."""

import math
from typing import Any

import pytest
from vehicle_bench import Bench

from ftc_autopilot.vehicle.controller_messages import ControllerMessages
from gcs.scenario.model import Scenario


@pytest.mark.parametrize("law", ["proposed", "pid"])
def test_a_law_without_adaptive_estimates_reports_none(scenario1: Scenario, law: str) -> None:
    flown = Scenario.model_validate(scenario1.model_dump() | {"controller": {"kind": law}})
    bench = Bench(flown)
    bench.controllers.uavs[0]["controller"]["proposed"]["beta_v"] = 2.5
    message: Any = ControllerMessages(bench.hot, bench.controllers, flown.controller).adaptation()
    estimates = message.phi_v, message.g_v, message.beta_v, message.phi_omega, message.beta_omega
    if law == "proposed":
        assert estimates == (0.0, 0.0, 2.5, 0.0, 0.0)
    else:
        assert all(map(math.isnan, estimates))

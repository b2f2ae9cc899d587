"""What there was to be seen of a stuck surface: its distance, and its next command."""

import pytest

from benchmarks.late_detections import what_there_was
from gcs.scenario.model import Scenario
from gcs.scenario.sections import ScenarioFault


def test_the_distance_is_that_from_the_command_in_force(scenario1: Scenario) -> None:
    def seen(stuck_deg: float) -> tuple[float, float | None]:
        keys = {"uav": 2, "actuator": "rudder", "start_s": 0.2, "stuck_deg": stuck_deg}
        fault = ScenarioFault.model_validate(keys)
        return what_there_was(scenario1.model_copy(update={"duration_s": 0.4, "faults": (fault,)}))

    (left_deg, _), (right_deg, next_s) = seen(-25.0), seen(25.0)
    assert left_deg + right_deg == pytest.approx(50.0)
    assert next_s is not None
    assert 0.0 <= next_s < 0.2

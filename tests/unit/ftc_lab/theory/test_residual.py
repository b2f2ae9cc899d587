import numpy as np
import pytest
from theory_flights import synthetic

from ftc_lab.theory.residual import residual_sets
from gcs.scenario.model import Scenario

pytestmark = pytest.mark.slow


def test_residual_set_is_the_largest_error_of_the_last_seconds(scenario1: Scenario) -> None:
    recording = synthetic(24_000)
    error = recording.signals["error"]
    error[1000, 0, 0] = 9.0  # at 1 s, not within (1, 4] s
    error[4000, 0, 0] = -2.0  # at 4 s: still the first segment
    error[13_000, 0, 1] = np.radians(3.0)
    recording.signals["sync_error"][23_999, 0, 3] = np.radians(-4.0)
    first, second, third = residual_sets(recording, 0, scenario1)
    assert (first["from_s"], first["end_s"]) == (1.0, 4.0)
    assert first["tracking"]["airspeed_m_s"] == 2.0
    assert second["tracking"]["airspeed_m_s"] == 0.0
    assert second["tracking"]["roll_deg"] == pytest.approx(3.0)
    assert third["synchronisation"]["yaw_deg"] == pytest.approx(4.0)


def test_a_lost_flight_has_the_segments_that_it_reached(scenario1: Scenario) -> None:
    recording = synthetic(4500, loss="UAV 1 was lost")
    recording.signals["error"][4499, 0, 0] = np.nan
    sets = residual_sets(recording, 0, scenario1)
    assert [(s["from_s"], s["end_s"]) for s in sets] == [(1.0, 4.0), (4.0, 4.5)]
    assert sets[1]["tracking"]["airspeed_m_s"] == 0.0  # of the steps that there are


def test_a_segment_without_any_step_has_no_residual_set(scenario1: Scenario) -> None:
    recording = synthetic(10)
    recording.signals["error"][:] = np.nan
    (only,) = residual_sets(recording, 0, scenario1)
    assert set(only["tracking"].values()) == {None}

"""The first draws of the surviving law's campaigns: uncertain aircraft, real servos, noisy gyro."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from gcs.campaigns.flights import fly_rows
from gcs.campaigns.model import load_campaign
from gcs.campaigns.plan import plan, rows_of

CAMPAIGNS = Path(__file__).parents[5] / "scenarios" / "campaigns"


def results(name: str, draws: int, *variants: str) -> Iterator[dict]:
    path = CAMPAIGNS / f"{name}.yaml"
    planned = plan(load_campaign(path, draws), path)
    rows = [row for row in rows_of(planned.draws) if row["variant"] in variants]
    yield from fly_rows(planned.flights, rows).to_pylist()


@pytest.mark.slow
def test_no_healthy_actuator_is_declared_lost() -> None:
    """Movements of a suspect rudder once renewed the suspicion, until its loop oscillated."""
    for row in results("false_alarms", 3, "realistic", "moderate"):
        assert row["outcome"] == "completed", row["reason"]
        assert [row[f"uav{k}.false_alarms"] for k in (1, 2, 3)] == [0, 0, 0]


@pytest.mark.slow
def test_a_stuck_rudder_is_survived() -> None:
    """The transient of a lost rudder once passed for a lost aileron."""
    for row in results("stuck_surface", 3, "rudder_real"):
        assert max(row["uav3.max_error_roll"], row["uav3.max_error_pitch"]) < 45.0
        assert row["uav3.detection_s"] < 0.25
        assert row["uav1.max_error_roll"] < 1.5

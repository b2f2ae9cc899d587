"""Some draws of the surviving law's campaigns: uncertain aircraft, real servos, noisy gyro."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from gcs.campaigns.flights import fly_rows
from gcs.campaigns.model import load_campaign
from gcs.campaigns.plan import plan, rows_of

CAMPAIGNS = Path(__file__).parents[5] / "scenarios" / "campaigns"


def results(name: str, draws: Sequence[int], *variants: str) -> Iterator[dict]:
    path = CAMPAIGNS / f"{name}.yaml"
    planned = plan(load_campaign(path, max(draws) + 1), path)
    rows = [
        row for row in rows_of(planned.draws) if row["variant"] in variants and row["draw"] in draws
    ]
    yield from fly_rows(planned.flights, rows).to_pylist()


@pytest.mark.slow
def test_no_healthy_actuator_is_declared_lost() -> None:
    """Movements of a suspect rudder once renewed the suspicion, until its loop oscillated."""
    for row in results("false_alarms", range(3), "realistic", "moderate"):
        assert row["outcome"] == "completed", row["reason"]
        assert [row[f"uav{k}.false_alarms"] for k in (1, 2, 3)] == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("actuator", "draws", "soon"),
    [("aileron", (0, 34, 48), 0.12), ("elevator", (0, 3, 55), 2.0), ("rudder", (0, 12, 18), 0.25)],
)
def test_a_stuck_surface_is_survived_and_no_other_one_blamed(
    actuator: str, draws: tuple[int, ...], soon: float
) -> None:
    """The transients of these losses once passed for the loss of another surface."""
    for row in results("stuck_surface", draws, f"{actuator}_real"):
        assert max(row["uav3.max_error_roll"], row["uav3.max_error_pitch"]) < 45.0
        assert [row[f"uav{k}.false_alarms"] for k in (1, 2, 3)] == [0, 0, 0]
        assert row["uav3.detection_s"] < soon
        assert row["uav1.max_error_roll"] < 1.5

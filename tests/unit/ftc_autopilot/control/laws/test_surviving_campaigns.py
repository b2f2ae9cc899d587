"""Some draws of the surviving law's campaigns: uncertain aircraft, real servos, noisy gyro."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from ftc_lab.campaigns.flights import Flights, Row, fly_rows
from ftc_lab.campaigns.model import load_campaign
from ftc_lab.campaigns.plan import plan, rows_of
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise

CAMPAIGNS = Path(__file__).parents[5] / "scenarios" / "campaigns"


def rows(name: str, draws: Sequence[int], *variants: str) -> tuple[Flights, list[Row]]:
    path = CAMPAIGNS / f"{name}.yaml"
    planned = plan(load_campaign(path, max(draws) + 1), path)
    return planned.flights, [
        row for row in rows_of(planned.draws) if row["variant"] in variants and row["draw"] in draws
    ]


def results(name: str, draws: Sequence[int], *variants: str) -> Iterator[dict]:
    yield from fly_rows(*rows(name, draws, *variants)).to_pylist()


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


@pytest.mark.slow
def test_a_rudder_stuck_far_from_its_command_is_found_by_its_first_movement_back() -> None:
    """The tail of its jump once passed for a movement of its own, for up to 176 ms."""
    for row in results("stuck_surface", (123, 185, 187), "rudder"):
        assert row["uav3.detection_s"] < 0.08


@pytest.mark.slow
def test_an_aircraft_that_needs_nearly_all_of_its_rudder_gets_it() -> None:
    """They need 34.5 of 35 deg: a rudder held 1.2 deg short of its stop was never sent the rest."""
    flights, chosen = rows("stuck_surface", (28, 41), "aileron_real")
    for row in chosen:
        for seed in range(1, 7):
            scenario = flights.scenario(row).model_copy(update={"seed": seed})
            uav = summarise(fly_in_process(scenario), scenario).uavs[2]
            assert (uav.iae["roll"] or 0.0) < 45.0

"""Flying rows on workers that live, die, and are distinguished from the flights that kill them."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign_flights import deadly, planned, rows_by_number

from ftc_lab.campaigns.engine import KILLS, _Queue, fly, missing_rows
from ftc_lab.campaigns.flights import Flights, fly_rows
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.plan import Plan, rows_of
from ftc_lab.campaigns.store import read_results
from ftc_lab.campaigns.workers import Flown, local_workers
from ftc_lab.run import run_campaign

pytestmark = pytest.mark.slow


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    short = planned()
    open_folder(tmp_path / "out", short)
    return short


def flown(plan: Plan, folder: Path, flights: Flights, workers: int = 2) -> None:
    missing = missing_rows(folder, plan.draws.num_rows)
    with contextlib.closing(local_workers(workers, flights)) as processes:
        rows = rows_of(plan.draws.take(missing))
        fly(processes, flights, rows, len(missing), folder, lambda _: None)


def test_workers_fly_what_one_process_flies(plan: Plan, tmp_path: Path) -> None:
    flown(plan, tmp_path / "out", plan.flights)
    alone = fly_rows(plan.flights, list(rows_of(plan.draws)))
    found = rows_by_number(read_results(tmp_path / "out"))
    assert found == rows_by_number(alone)
    assert list(found) == list(range(8))
    assert len({row["uav1.iae_airspeed"] for row in found.values()}) == 8


def test_a_flight_that_kills_its_process_is_recorded_and_no_other(
    plan: Plan, tmp_path: Path
) -> None:
    """One kills every process, one dies once only: of it nothing is seen."""
    flown(plan, tmp_path / "out", deadly(plan, {3: 99, 5: 1}, tmp_path))
    rows = rows_by_number(read_results(tmp_path / "out"))
    assert list(rows) == list(range(8))
    assert {n for n, row in rows.items() if row["outcome"] == "crashed"} == {3}
    assert len(list(tmp_path.glob("3-*"))) == KILLS
    assert rows[3]["factor.uncertainty.mass"] is not None
    assert rows[3]["uav1.iae_airspeed"] is None
    assert "killed 3 times" in rows[3]["reason"]


def test_a_campaign_from_python_is_whole(tmp_path: Path) -> None:
    """Flights, report and kept trajectories are there; the second call has nothing left to fly."""
    short = planned(keep={"worst": 1, "figures": ["uav1.iae_roll"]})
    batches: list[Flown] = []
    page = run_campaign(short, tmp_path / "out", jobs=1, on_flown=batches.append)
    assert sum(batch.rows.num_rows for batch in batches) == 8
    assert read_results(tmp_path / "out").num_rows == 8
    assert page == tmp_path / "out" / "report.html"
    assert "A short campaign" in page.read_text()
    assert len(list((tmp_path / "out" / "flights").iterdir())) == 1
    batches.clear()
    until = "p(failure) < 0.999 at 90 %"
    assert run_campaign(short, tmp_path / "out", until=until, on_flown=batches.append) == page
    assert batches == []
    assert until in page.read_text().replace("&lt;", "<")


def test_rows_are_dealt_in_batches_of_measured_size() -> None:
    def rows() -> Iterator[dict[str, int]]:
        yield from ({"row": k} for k in range(100))

    queue = _Queue(rows(), 100)
    assert len(queue.next_batch(2)) == 1  # nothing is known yet
    queue.flight_s = 0.2
    assert len(queue.next_batch(2)) == 10  # 2 s
    queue.flight_s = 1e-3
    assert [len(queue.next_batch(2)) for _ in range(3)] == [23, 17, 13]  # all end together
    queue.flight_s = 60.0
    assert len(queue.next_batch(2)) == 1

"""The recording of a fleet without an end: bounded in size, and never the fleet's end."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from fleet_writers import FRAME, Writers

from gcs.fleet.standing_record import LOG, PREVIOUS, StandingRecord
from gcs.results.store import EVENTS, TRAJECTORY, batches
from gcs.scenario.model import Scenario
from mavlink_defs.capture.tlog import read_tlog


@pytest.fixture
def messages() -> list[str]:
    return []


def times(folder: Path) -> list[float]:
    return [t for batch in batches(folder / TRAJECTORY) for t in batch["time_s"].to_pylist()]


def test_the_newest_of_a_long_flight_is_kept_and_no_more(
    scenario1: Scenario, tmp_path: Path, messages: list[str]
) -> None:
    record, limit = StandingRecord(scenario1, tmp_path, messages.append, 60_000), 60_000
    writers = Writers(scenario1, tmp_path)
    most = 0
    for second in range(30):
        writers.write()
        for _ in range(200):
            record.log(FRAME)
        record.collect(2.0 * second)
        most = max(most, sum(f.stat().st_size for f in tmp_path.rglob("*") if f.is_file()))
    record.close()
    assert messages == []
    assert most < 4 * limit
    old, new = times(tmp_path / PREVIOUS), times(tmp_path)
    assert new[-1] > 29.9
    assert old[0] > 1.0  # what was before is gone
    assert np.all(np.diff([*old, *new][::3]) == pytest.approx(0.02))  # without a gap
    assert all(list(batches(folder / EVENTS)) for folder in (tmp_path, tmp_path / PREVIOUS))
    assert list(read_tlog(tmp_path / PREVIOUS / LOG))
    assert not list((tmp_path / "processes").glob("*"))


def test_an_autopilot_that_is_gone_holds_nothing_up(
    scenario1: Scenario, tmp_path: Path, messages: list[str]
) -> None:
    record = StandingRecord(scenario1, tmp_path, messages.append)
    writers = Writers(scenario1, tmp_path)
    for second in range(12):
        writers.write(*(["uav2"] if second > 3 else []))
        record.collect(float(second))
        assert len(list((tmp_path / "processes/plant").glob("*.npy"))) <= 3
    record.close()
    assert times(tmp_path)[-1] > 11.9


def test_a_folder_that_is_lost_ends_the_recording_with_one_message(
    scenario1: Scenario, tmp_path: Path, messages: list[str]
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    record = StandingRecord(scenario1, folder, messages.append)
    shutil.rmtree(folder)
    for second in range(3):
        record.log(FRAME)
        record.collect(2.0 * second)
    record.close()
    (message,) = messages
    assert message.startswith(f"recording ended: cannot write {folder}")
    assert message.endswith("the fleet flies on")

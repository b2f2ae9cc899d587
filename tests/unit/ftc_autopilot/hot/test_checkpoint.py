"""What an autopilot keeps: it comes back as a whole, however writing it was cut short."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.hot.checkpoint import (
    Checkpoint,
    map_array,
    no_checkpoint,
    open_checkpoint,
    restore,
    save,
)

RECORD = np.dtype([("step", "i8"), ("value", "f8", (3,)), ("flag", "u1")])
OWN = np.dtype([("first", RECORD), ("between", "i8"), ("second", RECORD)])
SAVED = np.array([[0, RECORD.itemsize], [RECORD.itemsize + 8, OWN.itemsize]])


class Process:
    """The records of one process, and its file."""

    def __init__(self, path: Path, configuration: str = "uav 1") -> None:
        self.own, self.edges = np.zeros(1, OWN), np.zeros((1, 2), RECORD)
        self.records = [self.own["first"], self.own["second"], *self.edges.reshape(2, 1)]
        self.checkpoint: Checkpoint = open_checkpoint(path, SAVED, self.edges[0], configuration)
        self.resumes = restore(self.checkpoint, self.own, self.edges[0])

    def save(self, step: int) -> None:
        for k, record in enumerate(self.records):
            record["step"], record["value"], record["flag"] = step, 0.1 * step + k, k
        self.own["between"] = step
        save(self.checkpoint, self.own, self.edges)

    def step(self) -> int:
        """The step of the records, which must all be of it; what is not saved stays 0."""
        (step,) = {int(record["step"][0]) for record in self.records}
        for k, record in enumerate(self.records):
            assert step == 0 or (record["value"] == 0.1 * step + k).all()
        return step


def test_it_begins_empty_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "uav1.checkpoint"
    process = Process(path)
    assert not process.resumes
    for step in range(1, 6):
        process.save(step)
        again = Process(path)
        assert (again.resumes, again.step()) == (True, step)
    assert again.own["between"] == 0
    again.save(17)  # counts on, does not begin with a slot of its own
    assert Process(path).step() == 17


def test_another_configuration_begins_empty(tmp_path: Path) -> None:
    path = tmp_path / "uav1.checkpoint"
    Process(path).save(5)
    other = Process(path, "uav 1 with another law")
    assert (other.resumes, other.step()) == (False, 0)


@given(
    steps=st.integers(1, 4),
    torn=st.lists(st.tuples(st.integers(0, 10_000), st.integers(1, 255)), min_size=1, max_size=20),
)
def test_a_torn_slot_is_never_taken_for_a_whole_one(
    steps: int, torn: list[tuple[int, int]]
) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "uav1.checkpoint"
        process = Process(path)
        for step in range(1, steps + 1):
            process.save(step)
        newest = int(np.argmax(process.checkpoint.as_u64[:, 0]))
        before = process.checkpoint.slots[newest].copy()
        for place, change in torn:
            process.checkpoint.slots[newest, place % len(before)] ^= change
        untouched = (before == process.checkpoint.slots[newest]).all()
        again = Process(path)
        assert again.step() == (steps if untouched else steps - 1)
        assert again.resumes == (again.step() > 0)


def test_a_process_that_dies_while_it_writes_leaves_the_step_before(tmp_path: Path) -> None:
    path = tmp_path / "uav1.checkpoint"
    process = Process(path)
    process.save(1)
    process.save(2)
    older = int(np.argmin(process.checkpoint.as_u64[:, 0]))
    half = process.checkpoint.slots.shape[1] // 2
    process.checkpoint.slots[older, 16:half] = process.checkpoint.slots[
        1 - older, 16:half
    ]  # of step 3, say
    assert Process(path).step() == 2
    process.checkpoint.as_u64[older, 0] = 3  # its count is written, its checksum is not
    assert Process(path).step() == 2


def test_without_a_file_nothing_is_saved() -> None:
    nothing = no_checkpoint()
    save(nothing, np.zeros(1, OWN), np.zeros((1, 2), RECORD))
    assert nothing.written[0] == 0


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "uav1.checkpoint"
    with pytest.raises(OSError, match=r"uav1\.checkpoint"):
        map_array(path, np.dtype("f8"), 3)


def test_a_full_disk_is_reported_before_the_flight() -> None:
    """Space is taken at once, or the process would be killed by SIGBUS in flight."""
    with pytest.raises(OSError, match="fleet") as reported:
        map_array(Path("/dev/shm/fleet"), np.dtype("u1"), 2**50)
    Path("/dev/shm/fleet").unlink()
    assert reported.value.errno is not None

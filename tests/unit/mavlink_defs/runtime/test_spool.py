"""A recording on disk is handed over piece by piece, and a torn one is known as such."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs.runtime.spool import Spool, SpoolReader


@given(st.lists(st.integers(1, 5), max_size=8), st.sets(st.integers(0, 8)))
def test_a_reader_gets_all_rows_in_order_whenever_it_polls(
    tmp_path_factory: pytest.TempPathFactory, sizes: list[int], polls: set[int]
) -> None:
    folder = tmp_path_factory.mktemp("spool") / "plant"
    spool, reader = Spool(folder), SpoolReader(folder)
    written = 0
    read: list[int] = []

    def poll() -> None:
        while (piece := reader.take()) is not None:
            first, rows = piece
            assert first == len(read)
            read.extend(rows.tolist())

    for k, size in enumerate(sizes):
        if k in polls:
            poll()
        spool.write(written, np.arange(written, written + size))
        written += size
    assert reader.facts is None
    spool.finish(loss=None, steps=written)
    poll()
    assert read == list(range(written))
    assert reader.facts == {"loss": None, "steps": written}
    reader.remove()
    assert not folder.exists()


def test_a_recording_that_begins_again_has_nothing_of_the_old_one(tmp_path: Path) -> None:
    old = Spool(tmp_path / "uav1")
    old.write(0, np.ones(3))
    old.finish(loss=None)
    new, reader = Spool(tmp_path / "uav1"), SpoolReader(tmp_path / "uav1")
    assert reader.facts is None
    assert reader.take() is None
    new.write(0, np.zeros(2))
    assert reader.take() is not None


def test_what_a_killed_process_left_half_written_is_not_read(tmp_path: Path) -> None:
    spool, reader = Spool(tmp_path / "uav1"), SpoolReader(tmp_path / "uav1")
    spool.write(0, np.arange(3))
    whole = (tmp_path / "uav1" / "0000000000.npy").read_bytes()
    (tmp_path / "uav1" / "0000000001.npy.part").write_bytes(whole[:-4])
    (tmp_path / "uav1" / "end.json").write_text('{"loss": nu')
    assert reader.take() is not None
    assert reader.take() is None
    assert reader.facts is None


def test_a_process_that_is_started_again_goes_on_with_its_recording(tmp_path: Path) -> None:
    reader = SpoolReader(tmp_path / "uav1")
    Spool(tmp_path / "uav1").write(0, np.arange(3))
    Spool(tmp_path / "uav1", resume=True).write(3, np.arange(3, 5))
    first, second = reader.take(), reader.take()
    assert first is not None
    assert second is not None
    assert [(n, rows.tolist()) for n, rows in (first, second)] == [(0, [0, 1, 2]), (3, [3, 4])]
    assert reader.take() is None

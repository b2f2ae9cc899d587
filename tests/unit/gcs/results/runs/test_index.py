"""The index is never believed against the folders, and never in the way."""

import contextlib
import json
import multiprocessing
import os
import shutil
import sqlite3
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_folders import make_run

from gcs.console.errors import BadInput
from gcs.results.runs.index import INDEX, Listing, list_runs

NAMES = ("a", "b", "sub/c", "sub/d")
STEPS = st.lists(
    st.tuples(
        st.sampled_from(["make", "remove", "saving", "note", "damage", "mend", "index", "list"]),
        st.sampled_from(NAMES),
        st.integers(1, 5),
    ),
    max_size=12,
)


def without_index(root: Path, copy: Path) -> Listing:
    """The list of a folder that never had an index."""
    shutil.copytree(root, copy, ignore=shutil.ignore_patterns(f"{INDEX}*"))
    try:
        return list_runs(copy)
    finally:
        shutil.rmtree(copy)


def told(listing: Listing) -> tuple[list[dict[str, object]], list[tuple[str, str]]]:
    """What a list says, in an order of its own; folders' paths are not its business."""
    runs = sorted((run.to_json() for run in listing.runs), key=lambda run: str(run["name"]))
    return runs, [(one.name, one.reason.rpartition("summary.json")[2]) for one in listing.foreign]


@given(steps=STEPS)
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_an_index_that_is_updated_equals_one_that_is_made_anew(
    cache: Path, tmp_path: Path, steps: list[tuple[str, str, int]]
) -> None:
    root = tmp_path / "runs"
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    for action, name, number in steps:
        act(cache, root, action, name, number)
    updated = told(list_runs(root))
    assert updated == told(without_index(root, tmp_path / "copy"))
    assert updated == told(list_runs(root, rebuild=True))
    assert list_runs(root).read == len(list_runs(root).foreign)  # damaged ones only


def act(cache: Path, root: Path, action: str, name: str, number: int) -> None:
    folder = root / name
    match action:
        case "make" if not folder.exists():
            make_run(cache, folder)
        case "remove":
            shutil.rmtree(folder, ignore_errors=True)
        case "saving" if (folder / "summary.json").exists():
            shutil.rmtree(folder)
            make_run(cache, folder, saving=number / 10)
        case "note" if folder.exists():
            (folder / "note.txt").write_text(f"note {number}")
        case "damage" if folder.exists():
            (folder / "summary.json").write_text("{" * number)
        case "mend" if folder.exists():
            shutil.rmtree(folder)
            make_run(cache, folder)
        case "index":
            (root / INDEX).write_bytes(b"no database" * number)
        case "list":
            list_runs(root)


def test_only_what_changed_is_read_again(cache: Path, tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        make_run(cache, tmp_path / name)
    assert list_runs(tmp_path).read == 3
    assert list_runs(tmp_path).read == 0
    (tmp_path / "b" / "note.txt").write_text("mine")
    listing = list_runs(tmp_path)
    assert listing.read == 1
    assert {run.name: run.note for run in listing.runs} == {"a": "", "b": "mine", "c": ""}


def test_a_summary_written_again_with_the_same_size_is_read_again(
    cache: Path, tmp_path: Path
) -> None:
    folder = make_run(cache, tmp_path / "a", saving=0.25)
    (run,) = list_runs(tmp_path).runs
    assert run.saving == 0.25
    path = folder / "summary.json"
    before = path.stat()
    part = folder / "summary.json.part"
    part.write_text(path.read_text().replace('"saving": 0.25', '"saving": 0.75'))
    part.replace(path)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))  # even so: another inode
    assert path.stat().st_size == before.st_size
    (run,) = list_runs(tmp_path).runs
    assert run.saving == 0.75


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE runs SET entry = 'nonsense'",
        "UPDATE runs SET entry = '[]'",
        "UPDATE runs SET entry = '{}'",
        "UPDATE runs SET stamp = ''",
        "DROP TABLE runs",
        "PRAGMA user_version = 7",
        "UPDATE runs SET name = 'elsewhere'",
    ],
)
def test_an_index_that_makes_no_sense_is_made_anew(
    cache: Path, tmp_path: Path, change: str
) -> None:
    make_run(cache, tmp_path / "a")
    expected = told(list_runs(tmp_path))
    with contextlib.closing(sqlite3.connect(tmp_path / INDEX)) as database, database:
        database.execute(change)
    again = list_runs(tmp_path)
    assert told(again) == expected
    assert again.read == 1
    assert list_runs(tmp_path).read == 0


def test_an_index_that_cannot_be_written_is_done_without(cache: Path, tmp_path: Path) -> None:
    make_run(cache, tmp_path / "a")
    (tmp_path / INDEX).mkdir()  # as root, a test cannot make a folder read-only
    assert len(list_runs(tmp_path).runs) == 1
    assert len(list_runs(tmp_path, rebuild=True).runs) == 1


def test_an_index_that_another_command_holds_is_done_without(cache: Path, tmp_path: Path) -> None:
    make_run(cache, tmp_path / "a")
    list_runs(tmp_path)
    make_run(cache, tmp_path / "b")
    with contextlib.closing(sqlite3.connect(tmp_path / INDEX, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        assert len(list_runs(tmp_path).runs) == 2
        other.execute("COMMIT")
    assert list_runs(tmp_path).read == 2 - 1


def list_often(root: Path, times: int) -> None:
    for _ in range(times):
        assert len(list_runs(root, rebuild=True).runs) == 12


def test_commands_at_once_do_not_disturb_each_other(cache: Path, tmp_path: Path) -> None:
    for number in range(12):
        make_run(cache, tmp_path / str(number), saving=number / 20)
    context = multiprocessing.get_context("fork")
    others = [context.Process(target=list_often, args=(tmp_path, 10)) for _ in range(3)]
    for one in others:
        one.start()
    list_often(tmp_path, 10)
    for one in others:
        one.join()
    assert [one.exitcode for one in others] == [0, 0, 0]
    listing = list_runs(tmp_path)
    assert {run.name: run.saving for run in listing.runs} == {str(k): k / 20 for k in range(12)}


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="nowhere: No such file"):
        list_runs(tmp_path / "nowhere")


def test_a_run_lists_itself_and_gets_no_index(cache: Path, tmp_path: Path) -> None:
    folder = make_run(cache, tmp_path / "a")
    assert [run.name for run in list_runs(folder).runs] == ["a"]
    assert not (folder / INDEX).exists()


def test_the_index_holds_what_json_prints(cache: Path, tmp_path: Path) -> None:
    make_run(cache, tmp_path / "a")
    (run,) = list_runs(tmp_path).runs
    with contextlib.closing(sqlite3.connect(tmp_path / INDEX)) as database:
        (row,) = database.execute("SELECT entry FROM runs").fetchall()
    assert json.loads(row[0]) == json.loads(json.dumps(run.to_json()))

"""``gcs campaign`` from outside: the table, going on after any end, and a cluster elsewhere."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from campaign_flights import rows_by_number, write_campaign
from flying import (
    BIN,
    TIMEOUT_S,
    assert_one_message,
    environment,
    free_links,
    run,
    start,
    wait_until,
)

from ftc_lab.campaigns.mark import mark_of
from ftc_lab.campaigns.store import read_results

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
DRAWS = 20
LONG = {"draws": DRAWS, "variants": {"long": {}}}
"""Flights that take one process several seconds together; results are stored after two."""


def campaign(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return run("gcs", "campaign", *arguments, env=environment())


def results(folder: Path) -> dict[int, dict[str, Any]]:
    return rows_by_number(read_results(folder))


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "results").glob("part-*.parquet"))


@contextlib.contextmanager
def flying(
    folder: Path, *arguments: str | Path, own_group: bool = False
) -> Iterator[subprocess.Popen[str]]:
    """A campaign that has stored some flights and flies on, maybe in a process group of its own."""
    if own_group:
        popen = subprocess.Popen(
            [BIN / "gcs", "campaign", *arguments, "--out", folder],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
            start_new_session=True,
        )
    else:
        popen = start("gcs", "campaign", *arguments, "--out", folder)
    try:
        wait_until(lambda: bool(parts(folder)) or popen.poll() is not None, "flights are stored")
        yield popen
    finally:
        popen.kill()
        popen.communicate(timeout=TIMEOUT_S)


def test_rows_are_flights_that_fly_again_bit_for_bit(tmp_path: Path) -> None:
    """Over the wire and in process; rows of every outcome, and those with a folder of their own."""
    stuck = {"kinds": {"stuck": {"kind": "choice", "values": [0.9]}}}
    fault = {**stuck, "uavs": [2], "actuators": ["aileron"]}
    start = {"start_s": {"kind": "uniform", "low": 0.1, "high": 0.2}}
    links = free_links()
    path = write_campaign(
        tmp_path,
        draws=2,
        faults={"f": fault | start},
        variants={
            "short": {"duration_s": 0.3, "faults": [], "links": links},
            "long": {"duration_s": 1.5, "faults": [], "links": links},
        },
        keep={"worst": 1, "figures": ["uav2.iae_roll"], "failures": 1},
    )
    folder = tmp_path / "out"
    done = campaign(path, "--out", folder, "--jobs", "2")
    assert done.returncode == 0, done.stderr
    assert_one_message(done.stdout)
    rows = results(folder)
    assert [(row["variant"], row["draw"]) for row in rows.values()] == [
        ("short", 0), ("long", 0), ("short", 1), ("long", 1),
    ]  # fmt: skip
    assert {row["outcome"] for row in rows.values() if row["variant"] == "short"} == {"completed"}
    lost = {n for n, row in rows.items() if row["variant"] == "long"}
    assert {rows[n]["outcome"] for n in lost} <= {"attitude_lost", "model_left"}
    assert all("UAV 2" in rows[n]["reason"] for n in lost)

    again = ("fly", "--campaign", folder, "--row")
    for number, how in ((0, ("--in-process",)), (0, ()), (min(lost), ())):
        out = tmp_path / f"again{number}{len(how)}"
        flown = run("gcs", *again, str(number), *how, "--json", "--out", out)
        assert "Traceback" not in flown.stderr
        summary = json.loads(flown.stdout)
        assert summary["uavs"][1]["iae"]["roll"] == rows[number]["uav2.iae_roll"]
        assert flown.returncode == (rows[number]["outcome"] == "model_left")

    kept = {int(path.name) for path in (folder / "flights").iterdir()}
    assert kept & lost
    for number in kept:
        at = folder / "flights" / str(number)
        assert {p.name for p in at.iterdir()} >= {"scenario.yaml", "trajectory.npz"}
        summary = json.loads((at / "summary.json").read_text())
        assert summary["uavs"][1]["iae"]["roll"] == rows[number]["uav2.iae_roll"]

    data = [p for name in ("results", "flights") for p in (folder / name).rglob("*")]
    before = {path: path.stat().st_mtime_ns for path in data}
    page = (folder / "report.html").read_bytes()
    assert campaign(path, "--out", folder, "--quiet").stderr == ""
    assert {path: path.stat().st_mtime_ns for path in data} == before
    assert (folder / "report.html").read_bytes() == page
    write_campaign(tmp_path, seed=8)
    other = campaign(path, "--out", folder)
    assert other.returncode == 2
    assert "belongs to another campaign" in other.stderr


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_the_same_command_continues_after_any_end(tmp_path: Path, end: signal.Signals) -> None:
    """Killed without a word, or by Ctrl-C, which a terminal sends to all of its processes."""
    path, folder = write_campaign(tmp_path, **LONG), tmp_path / "out"
    to_all = end == signal.SIGINT
    with flying(folder, path, "--jobs", "1", own_group=to_all) as popen:
        send = os.killpg if to_all else os.kill
        send(popen.pid, end)
        _, text = popen.communicate(timeout=TIMEOUT_S)
    before = results(folder)
    if end == signal.SIGINT:
        assert popen.returncode == 130
        assert_one_message(text)
        assert f"{len(before)} of 20 flights in {folder}" in text
    kept = {path: path.read_bytes() for path in parts(folder)}
    done = campaign(path, "--out", folder, "--jobs", "1")
    assert done.returncode == 0, done.stderr
    assert f"{len(before)} of 20 flights already flown" in done.stderr
    assert {path: path.read_bytes() for path in kept} == kept
    rows = results(folder)
    assert list(rows) == list(range(20))
    assert {n: rows[n] for n in before} == before
    assert read_results(folder, ["row"]).num_rows == 20


@contextlib.contextmanager
def scheduler(tmp_path: Path, workers: int, **changes: str) -> Iterator[Any]:
    """A dask scheduler and workers as processes of their own; yields address and processes."""
    with contextlib.ExitStack() as stack:

        def begin(*arguments: str | Path) -> subprocess.Popen[bytes]:
            popen = subprocess.Popen(
                [BIN / "dask", *arguments],
                env=environment(**changes),
                cwd=tmp_path,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(popen.wait, TIMEOUT_S)
            stack.callback(popen.terminate)
            return popen

        file = tmp_path / "scheduler.json"
        where = ("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", file)
        processes = [begin("scheduler", "--port", "0", *where)]
        wait_until(lambda: file.exists() and file.read_text().endswith("}"), "a scheduler")
        address = json.loads(file.read_text())["address"]
        options = ("--nthreads", "1", "--no-dashboard", "--local-directory", tmp_path)
        processes += [begin("worker", address, *options) for _ in range(workers)]
        yield address, processes


def test_a_cluster_elsewhere(tmp_path: Path) -> None:
    """A worker dies, then the scheduler: nothing that is stored is lost or flown twice."""
    path, folder = write_campaign(tmp_path, **LONG), tmp_path / "out"
    with scheduler(tmp_path, workers=2) as (address, processes):
        with flying(folder, path, "--scheduler", address) as popen:
            processes[1].kill()
            processes[0].kill()
            _, text = popen.communicate(timeout=TIMEOUT_S)
        assert popen.returncode == 1, text
        assert_one_message(text)
        assert "the connection to the scheduler was lost" in text
    before = results(folder)
    assert before
    assert campaign(path, "--out", folder).returncode == 0
    rows = results(folder)
    assert list(rows) == list(range(DRAWS))
    assert {n: rows[n] for n in before} == before


def test_workers_of_other_code_are_refused_with_both_digests(tmp_path: Path) -> None:
    copy = tmp_path / "other"
    for package in ("gcs", "mavlink_defs", "sitl_plant", "ftc_autopilot", "ftc_lab"):
        shutil.copytree(ROOT / package, copy / package)
    with (copy / "gcs" / "results" / "quantities.py").open("a") as file:
        file.write("# changed\n")
    path, folder = write_campaign(tmp_path), tmp_path / "out"
    with scheduler(tmp_path, workers=1, PYTHONPATH=str(copy)) as (address, _):
        done = campaign(path, "--out", folder, "--scheduler", address)
    assert done.returncode == 2
    assert_one_message(done.stderr)
    digest = mark_of(folder).digest
    assert f"expected ftc-sitl 0.1.0 with digest {digest}" in done.stderr
    assert "runs ftc-sitl 0.1.0 with digest" in done.stderr
    assert not parts(folder)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--scheduler", "here"], "expected tcp://HOST:PORT"),
        (["--scheduler", "tcp://127.0.0.1:9", "--jobs", "1"], "leave one out"),
        (["--draws", "0"], "--draws"),
        (["--seed", "1"], "--seed"),
    ],
)
def test_mistake_is_refused(tmp_path: Path, arguments: list[str], reason: str) -> None:
    done = campaign(write_campaign(tmp_path), *arguments, "--out", tmp_path / "out")
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert reason in done.stderr


def test_folder_of_something_else(tmp_path: Path) -> None:
    path = write_campaign(tmp_path)
    done = campaign(path, "--out", tmp_path)
    assert done.returncode == 2
    assert "not a campaign or sweep" in done.stderr
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "either a SCENARIO, or --campaign"),
        (["paper/scenario1", "--row", "1"], "either a SCENARIO, or --campaign"),
        (["--campaign", ".", "--row", "1"], "not the folder of a campaign"),
    ],
)
def test_flying_again_needs_a_campaign_and_a_row(arguments: list[str], reason: str) -> None:
    done = run("gcs", "fly", *arguments)
    assert done.returncode == 2
    assert reason in done.stderr

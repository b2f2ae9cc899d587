"""Places that cannot be written: one message with the name, and what was there is kept."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from flying import (
    BIN,
    TIMEOUT_S,
    assert_one_message,
    environment,
    processes_of,
    run,
    write_scenario,
)
from station import Up, up

from ftc_lab.campaigns.store import read_results

pytestmark = pytest.mark.sitl

NO_SPACE = "File too large"  # what a limit says where a full disk says "No space left on device"


def limited(
    size: int, *arguments: str | Path, cwd: Path | None = None, **changes: str
) -> subprocess.CompletedProcess[str]:
    """Run `gcs` with files that cannot grow beyond a size [bytes], as on a full disk."""
    return run("gcs", *arguments, env=environment(**changes), cwd=cwd, file_size=size)


def cannot_write(done: subprocess.CompletedProcess[str], path: Path, status: int = 1) -> None:
    assert done.returncode == status, done.stderr
    assert_one_message(done.stderr)
    (error,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert f"cannot write {path}: {NO_SPACE}" in error


@pytest.mark.parametrize(("size", "name"), [(0, "scenario.yaml"), (12_000, "flight.tlog")])
def test_a_flight_that_cannot_be_recorded_ends(tmp_path: Path, size: int, name: str) -> None:
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=60.0)
    options = ("--speed", "1", "--free-ports", "--quiet", "--out", folder)
    cannot_write(limited(size, "fly", scenario, *options), folder / name)
    assert not processes_of(folder)
    if size:
        assert size - 4096 < (folder / "flight.tlog").stat().st_size <= size


def test_a_process_that_cannot_keep_its_recording_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=2.0)
    options = (
        "--free-ports",
        "--quiet",
        "--set",
        "links.telemetry_clock=simulated",
        "--out",
        folder,
    )
    done = limited(100_000, "fly", scenario, *options)
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    assert re.search(rf"cannot write {folder}/processes/\w+/\d+\.npy: {NO_SPACE}", done.stderr)
    assert (folder / "flight.tlog").stat().st_size > 10_000
    assert not list(folder.rglob("*.part"))


@pytest.mark.parametrize(("size", "name"), [(0, "scenario.yaml"), (20_000, "events.arrows")])
def test_results_that_cannot_be_written(tmp_path: Path, size: int, name: str) -> None:
    scenario = write_scenario(tmp_path, duration_s=2.0)
    options = ("--in-process", "--quiet", "--out", tmp_path / "run")
    cannot_write(limited(size, "fly", scenario, *options), tmp_path / "run" / name)
    assert not (tmp_path / "run" / "summary.json").exists()


def test_a_key_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    done = limited(0, "key", tmp_path / "key")
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert f"{tmp_path / 'key'}: cannot be written: {NO_SPACE}" in done.stderr
    assert not (tmp_path / "key").exists()


def test_a_sweep_keeps_what_was_flown(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=0.05)
    options = ("sweep", scenario, "--set", "trigger.b1=0.01,0.02", "--quiet", "--out")
    assert run("gcs", *options, tmp_path / "run").returncode == 0
    for name in ("table.csv", "table.md", "sweep.png", "sweep.svg"):
        (tmp_path / "run" / name).unlink()
    done = limited(600, *options, tmp_path / "run")
    cannot_write(done, tmp_path / "run" / "table.csv")
    assert read_results(tmp_path / "run", ["row"]).num_rows == 2


def test_a_report_that_cannot_be_written(tmp_path: Path) -> None:
    done = limited(10_000, "reproduce", "--quiet", "--out", tmp_path / "run")
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    assert f"cannot write {tmp_path / 'run' / 'data'}" in done.stderr


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"HOME": "/proc/none", "XDG_CACHE_HOME": ""}, "/proc/none/.cache/ftc-sitl"),
        ({"XDG_CACHE_HOME": "/dev/null"}, "/dev/null/ftc-sitl"),
        ({"NUMBA_CACHE_DIR": "/proc/none"}, "/proc/none"),
    ],
)
def test_a_cache_that_cannot_be_written(
    tmp_path: Path, changes: dict[str, str], place: str
) -> None:
    scenario = write_scenario(tmp_path, duration_s=0.05)
    options = ("--in-process", "--quiet", "--out", tmp_path / "run")
    done = run("gcs", "fly", scenario, *options, env=environment(**changes))
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert done.stderr.startswith(f"{place}/core:")
    assert "XDG_CACHE_HOME or NUMBA_CACHE_DIR" in done.stderr


def test_standard_output_that_is_full(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=0.05)
    commands: list[list[str | Path]] = [
        ["fly", scenario, "--in-process", "--json", "--out", tmp_path / "run"],
        ["wireshark"],
        ["--help"],
    ]
    for arguments in commands:
        _assert_full(arguments, environment())
    assert (tmp_path / "run" / "summary.json").exists()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> "Iterator[Up]":
    with up(tmp_path_factory.mktemp("fleet")) as fleet:
        yield fleet


@pytest.mark.parametrize("arguments", [["status"], ["status", "--json"], ["status", "--watch"]])
def test_a_status_that_cannot_be_shown(fleet: Up, arguments: list[str]) -> None:
    _assert_full([*arguments], environment(FTC_SITL_CONNECT=fleet.hub))


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_reader_that_has_seen_enough_ends_a_watch(fleet: Up, options: list[str]) -> None:
    """`gcs status --watch | head -1`."""
    watch = fleet.begin("status", "--watch", *options)
    assert watch.stdout is not None
    assert watch.stderr is not None
    first = watch.stdout.readline()
    watch.stdout.close()
    try:
        assert ("vehicles" if options else "UAV") in first
        assert watch.wait(TIMEOUT_S) == 0
        assert watch.stderr.read() == ""
    finally:
        watch.kill()
        watch.stderr.close()


def test_a_log_that_cannot_grow_ends_a_recording(fleet: Up, tmp_path: Path) -> None:
    file = tmp_path / "flight.tlog"
    done = limited(8000, "record", file, FTC_SITL_CONNECT=fleet.hub)
    cannot_write(done, file)
    assert 4000 < file.stat().st_size <= 8000


def _assert_full(arguments: list[str | Path], env: dict[str, str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [BIN / "gcs", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=TIMEOUT_S,
            env=env,
            check=False,
        )
    assert done.returncode == 1, done.stderr
    message = "error: cannot write the standard output: No space left on device"
    assert message in done.stderr
    assert_one_message(done.stderr)

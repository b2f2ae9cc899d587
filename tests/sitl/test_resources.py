"""Resources that a machine runs out of: one message, and no process is left."""

import resource
import subprocess
from pathlib import Path

import pytest
from flying import (
    BIN,
    TIMEOUT_S,
    assert_one_message,
    environment,
    processes_of,
    summary_of,
    write_scenario,
)

pytestmark = pytest.mark.sitl


def limited(
    what: int, most: int, *arguments: str | Path, **changes: str
) -> subprocess.CompletedProcess[str]:
    """Run `gcs` under one of the limits of `ulimit`."""
    return subprocess.run(
        [BIN / "gcs", *arguments],
        preexec_fn=lambda: resource.setrlimit(what, (most, most)),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        env=environment(**changes),
        check=False,
    )


@pytest.mark.parametrize("is_compiled", [True, False])
@pytest.mark.parametrize("limit", [6, 8, 11])
def test_too_few_files_may_be_open(tmp_path: Path, limit: int, is_compiled: bool) -> None:
    """Wherever in its start the flight notices it."""
    folder = tmp_path / "run"
    command = ("fly", write_scenario(tmp_path, duration_s=0.1), "--free-ports", "--quiet")
    cache = {} if is_compiled else {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = limited(resource.RLIMIT_NOFILE, limit, *command, "--out", folder, **cache)
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    assert f"the limit is {limit}" in done.stderr
    assert "ulimit -n" in done.stderr
    assert not processes_of(folder)


def test_a_flight_needs_few_open_files(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=0.1)
    options = ("--free-ports", "--quiet", "--out", folder)
    done = limited(resource.RLIMIT_NOFILE, 32, "fly", scenario, *options)
    assert done.returncode == 0, done.stderr
    assert summary_of(folder)["completed"]


def test_a_restart_that_cannot_be_prepared_for_is_refused_before_the_flight(tmp_path: Path) -> None:
    """The space for what is kept is taken at the start: a disk full in flight does no harm."""
    folder = tmp_path / "run"
    scenario = write_scenario(tmp_path, duration_s=0.1)
    options = ("--restart", "on-failure", "--free-ports", "--quiet", "--out", folder)
    done = limited(resource.RLIMIT_FSIZE, 12_000, "fly", scenario, *options)
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert f"cannot write {folder / 'processes' / 'uav'}" in done.stderr
    assert ".checkpoint: File too large" in done.stderr
    assert not processes_of(folder)


def test_a_place_that_is_read_only(tmp_path: Path) -> None:
    folder = Path("/proc/sys/run")  # nobody can make a folder there
    scenario = write_scenario(tmp_path, duration_s=0.1)
    done = limited(resource.RLIMIT_NOFILE, 256, "fly", scenario, "--quiet", "--out", folder)
    assert done.returncode in {1, 2}
    assert_one_message(done.stderr)
    assert str(folder) in done.stderr

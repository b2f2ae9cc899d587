"""Somebody sets the clock of the machine, forward and back, while a signed fleet flies."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from flying import (
    BIN,
    TIMEOUT_S,
    arrays_of,
    environment,
    fly_well,
    processes_of,
    summary_of,
    wait_until,
    write_scenario,
)
from needs import needs

from mavlink_defs.framing.signing import make_key

pytestmark = pytest.mark.sitl
READ_CLOCK = "import time; print(time.time() - time.clock_gettime(time.CLOCK_MONOTONIC))"


class SetClock:
    """The date of the processes that are given `environment`; their monotonic clock is real."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "date"
        (library,) = Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1")
        self.environment = environment(
            LD_PRELOAD=str(library),
            FAKETIME_TIMESTAMP_FILE=str(self._file),
            FAKETIME_NO_CACHE="1",
            FAKETIME_DONT_FAKE_MONOTONIC="1",
        )
        self.set("+0")

    def set(self, change: str) -> None:
        """Set it to the real date and this, such as "+2h"."""
        new = self._file.with_suffix(".new")
        new.write_text(change)
        new.replace(self._file)

    def offset_s(self) -> float:
        command = [sys.executable, "-c", READ_CLOCK]
        return float(subprocess.check_output(command, env=self.environment))


def has_grown(path: Path, size: int) -> bool:
    return path.stat().st_size > size


@needs("faketime")
def test_a_flight_does_not_notice_that_the_clock_is_set(tmp_path: Path) -> None:
    clock = SetClock(tmp_path)
    begin_s = clock.offset_s()
    make_key(tmp_path / "key")
    scenario = write_scenario(tmp_path, duration_s=8.0)
    out, npz = tmp_path / "run", ("--record", "npz", "--quiet")
    options = ("--signing-key", tmp_path / "key", "--restart", "on-failure", "--free-ports")
    flight = subprocess.Popen(
        [BIN / "gcs", "fly", scenario, *npz, *options, "--out", out],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=clock.environment,
    )
    try:
        log, telemetry = out / "processes" / "plant.log", out / "flight.tlog"
        wait_until(lambda: log.exists() and "time starts" in log.read_text(), "it flies")
        for change in ("+2h", "-2h", "+0"):
            clock.set(change)
            size = telemetry.stat().st_size
            wait_until(partial(has_grown, telemetry, size), "it flies on")
            assert flight.poll() is None, "the flight was over before the clock was set"
        _, stderr = flight.communicate(timeout=TIMEOUT_S)
    finally:
        flight.kill()
        flight.wait()
    assert flight.returncode == 0, stderr
    assert not processes_of(out)
    clock.set("+2h")
    assert clock.offset_s() - begin_s == pytest.approx(7200.0, abs=60.0)  # the tool works

    assert summary_of(out)["completed"]
    assert "frames dropped" not in "".join(p.read_text() for p in (out / "processes").glob("*.log"))
    fly_well(scenario, *npz, "--in-process", "--out", tmp_path / "undisturbed")
    flown, expected = (arrays_of(tmp_path / name / "events.npz") for name in ("run", "undisturbed"))
    for key, array in expected.items():
        assert array.tobytes() == flown[key].tobytes(), key

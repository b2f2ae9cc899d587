"""Without the compiler (NUMBA_DISABLE_JIT=1) the same code gives the same flight, to the bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flying import arrays_of, fly_well, summary_of, write_scenario

pytestmark = pytest.mark.sitl

STEPS = 50
FLIGHTS = """
import hashlib

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.changes import with_changes

for name, additions, duration_s in (
    ("paper/scenario1", (), 0.4),
    ("paper/scenario1", ("tube",), 0.1),
    ("missions/hexagon", ("estimated",), 0.1),
):
    flight = fly_in_process(with_changes(name, additions, {"duration_s": duration_s}, "changes"))
    signals = [flight.signals[part] for part in flight.signals.dtype.names]
    arrays = (flight.states, flight.wind, flight.applied, *signals)
    print(name, hashlib.sha256(b"".join(one.tobytes() for one in arrays)).hexdigest())
"""


def test_plain_python_gives_the_same_flight(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=STEPS / 1000)
    options = ("--quiet", "--record=npz")
    fly_well(scenario, *options, "--in-process", "--out", tmp_path / "compiled")
    udp = ("--free-ports", "--out", tmp_path / "plain")
    fly_well(scenario, *options, *udp, NUMBA_DISABLE_JIT="1")
    assert summary_of(tmp_path / "plain")["completed"] is True
    for name in ("events.npz", "trajectory.npz"):
        plain, compiled = (arrays_of(tmp_path / way / name) for way in ("plain", "compiled"))
        assert plain.keys() == compiled.keys()
        for key, array in plain.items():
            assert np.array_equal(array, compiled[key], equal_nan=array.dtype.kind == "f"), key
    assert len(plain["state"]) == STEPS


def test_flights_have_the_same_bits() -> None:
    plain, compiled = (
        subprocess.run(
            [sys.executable, "-c", FLIGHTS],
            check=True,
            capture_output=True,
            text=True,
            env=os.environ | {"NUMBA_DISABLE_JIT": without},
        ).stdout.split()
        for without in "10"
    )
    assert len(plain) == 6
    assert plain == compiled

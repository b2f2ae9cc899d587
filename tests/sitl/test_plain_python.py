"""Without the compiler (NUMBA_DISABLE_JIT=1) the same code gives the same flight."""

from pathlib import Path

import numpy as np
import pytest
from flying import arrays_of, fly_well, summary_of, write_scenario

pytestmark = pytest.mark.sitl

STEPS = 50


@pytest.mark.parametrize("how", ["--in-process", "--free-ports"])
def test_plain_python_gives_the_same_flight(tmp_path: Path, how: str) -> None:
    scenario = write_scenario(tmp_path, duration_s=STEPS / 1000)
    options = ("--quiet", "--record=npz")
    fly_well(scenario, *options, "--in-process", "--out", tmp_path / "compiled")
    fly_well(scenario, *options, how, "--out", tmp_path / "plain", NUMBA_DISABLE_JIT="1")
    assert summary_of(tmp_path / "plain")["completed"] is True
    plain, compiled = (arrays_of(tmp_path / name / "events.npz") for name in ("plain", "compiled"))
    for key in ("uav", "channel", "step"):
        assert np.array_equal(plain[key], compiled[key]), key
    assert np.allclose(plain["value"], compiled["value"], rtol=0.0, atol=1e-9)
    plain, compiled = (
        arrays_of(tmp_path / name / "trajectory.npz") for name in ("plain", "compiled")
    )
    assert len(plain["state"]) == STEPS
    assert plain.keys() == compiled.keys()
    for key, array in plain.items():
        # plain Python's libm may differ in the last bit
        assert np.allclose(array, compiled[key], rtol=1e-9, atol=1e-9, equal_nan=True), key

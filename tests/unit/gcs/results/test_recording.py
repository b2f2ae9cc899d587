"""Errors of recorded angles are wrapped."""

from pathlib import Path

import numpy as np
import pytest

from ftc_autopilot.common.angles import wrap
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import wrap_all
from gcs.results.summary import summarise
from gcs.scenario.model import load_scenario


def test_whole_rolls_are_no_error(short: Path) -> None:
    scenario = load_scenario(short)
    recording = fly_in_process(scenario)
    before = summarise(recording, scenario).uavs[0].iae
    recording.states[:, 0, 6] += 4.0 * np.pi
    assert summarise(recording, scenario).uavs[0].iae == pytest.approx(before)


def test_angles_are_wrapped_one_by_one() -> None:
    angles = np.random.default_rng(1).normal(0.0, 9.0, 1000)
    angles[:6] = np.pi, -np.pi, -0.0, np.nan, np.inf, 3.0 * np.pi
    with np.errstate(invalid="ignore"):  # without compilation, NumPy warns of infinity
        one_by_one = np.array([wrap(angle) for angle in angles])
        wrap_all(angles[:, None])
    assert angles.tobytes() == one_by_one.tobytes()
    assert np.abs(angles[5:]).max() <= np.pi

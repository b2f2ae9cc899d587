"""Errors of sensors in statistics: what is drawn has the configured densities."""

import math
from typing import Any

import numpy as np
import pytest

from mavlink_defs.constants import GNSS, GYRO
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.errors import AXES, ERRORS, corrupt, turn_on
from sitl_plant.sensing.units import units_of

STEP_US = 10_000


def made(navigation: dict[str, Any], kind: int = GYRO, seed: int = 1, system: int = 1) -> np.void:
    """A sensor of a configuration of ideal sensors with a few errors."""
    sensors = NavigationSensors.model_validate({"grade": "ideal", **navigation})
    unit = next(unit for unit in units_of(sensors, STEP_US) if unit.kind == kind)
    record = np.zeros(1, ERRORS)[0]
    record["seed"], record["system"], record["channel"] = seed, system, 300
    record["axes"], record["every"] = len(unit.errors.noise), unit.every
    turn_on(record, unit.errors, unit.every * STEP_US / 1e6)
    return record


def at_rest(record: np.void, samples: int) -> np.ndarray:
    """Samples of a sensor whose true values are 0, shape (samples, axes)."""
    values, found = np.zeros(AXES), np.zeros((samples, int(record["axes"])))
    for k in range(samples):
        values[:] = 0.0
        corrupt(record, k, values)
        found[k] = values[: found.shape[1]]
    return found


def allan_deviation(samples: np.ndarray, tau_s: float, period_s: float) -> np.ndarray:
    """Allan deviation of each column: IEEE Std 952-1997, annex C, without overlap."""
    size = round(tau_s / period_s)
    clusters = len(samples) // size
    means = samples[: clusters * size].reshape(clusters, size, -1).mean(axis=1)
    return np.asarray(np.sqrt(0.5 * (np.diff(means, axis=0) ** 2).mean(axis=0)))


def test_white_noise_has_the_density_of_the_data_sheet() -> None:
    samples = at_rest(made({"gyro": {"noise_density_deg_s_sqrt_hz": 0.02}}), 30_000)
    assert np.degrees(samples.std()) == pytest.approx(0.02 * math.sqrt(50.0), rel=0.02)
    for tau_s, tolerance in ((0.1, 0.03), (1.0, 0.08)):
        expected = 0.02 / math.sqrt(2.0 * tau_s)  # angle random walk: density / sqrt(2)
        found = np.degrees(allan_deviation(samples, tau_s, STEP_US / 1e6))
        assert found.mean() == pytest.approx(expected, rel=tolerance)


def test_the_bias_instability_is_the_peak_of_the_allan_deviation() -> None:
    gyro = {"bias_instability_deg_h": 36.0, "correlation_s": 1.0}
    samples = at_rest(made({"gyro": gyro}), 60_000)
    tau_s = [0.3, 1.89, 12.0]
    found = [
        float(np.degrees(allan_deviation(samples, tau, STEP_US / 1e6)).mean()) * 3600.0
        for tau in tau_s
    ]
    assert found[1] == pytest.approx(36.0, rel=0.06)
    assert max(found[0], found[2]) < 0.85 * found[1]


@pytest.mark.parametrize("name", ["scale_error", "misalignment_deg", "turn_on_bias_deg_s"])
def test_turn_on_errors_have_their_standard_deviation(name: str) -> None:
    drawn, off = [], ~np.eye(3, dtype=bool)
    for seed in range(400):
        record = made({"gyro": {name: 0.1}}, seed=seed)
        matrix = record["matrix"] - np.eye(3)
        part = {
            "scale_error": np.diag(matrix),
            "misalignment_deg": np.degrees(matrix[off]),
            "turn_on_bias_deg_s": np.degrees(record["bias"][:3]),
        }
        drawn.append(part.pop(name))
        assert not any(rest.any() for rest in part.values())
    values = np.array(drawn)
    assert values.std() == pytest.approx(0.1, rel=0.1)
    assert abs(values.mean()) < 0.1 * 4.0 / math.sqrt(values.size)


def test_a_sample_is_the_matrix_times_the_truth_plus_the_bias() -> None:
    gyro = {"scale_error": 0.05, "misalignment_deg": 2.0, "turn_on_bias_deg_s": 1.0}
    record, truth = made({"gyro": gyro}), np.array([0.3, -0.2, 0.7, 0.0, 0.0, 0.0])
    values = truth.copy()
    corrupt(record, 7, values)
    assert values[:3] == pytest.approx(record["matrix"] @ truth[:3] + record["bias"][:3])


def test_the_error_of_a_position_is_correlated_in_time() -> None:
    gnss = {"horizontal_error_m": 2.0, "vertical_error_m": 3.0, "correlation_s": 5.0}
    samples = at_rest(made({"gnss": gnss}, GNSS), 20_000)
    assert samples.std(axis=0)[:3] == pytest.approx([2.0, 2.0, 3.0], rel=0.15)
    lag = 50  # 5 s at 10 Hz
    for axis in range(3):
        found = np.corrcoef(samples[:-lag, axis], samples[lag:, axis])[0, 1]
        assert found == pytest.approx(math.exp(-1.0), abs=0.12)
    assert not samples[:, 3:].any()

"""What each kind of sensor fault makes of samples."""

import math

import numpy as np
import pytest

from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_FAULTS, SensorName
from sitl_plant.sensing.failures import Failures, SensorRange, fail, fault_table, new_failures

KINDS = {kind.name: kind for kind in SENSOR_FAULTS.kinds}
STEP_US = 1000
GYRO_1, GYRO_2, GPS, PITOT = range(4)
RANGES = (
    SensorRange("gyro", 1, 0.01, -35.0, 35.0),
    SensorRange("gyro", 2, 0.01, -35.0, 35.0),
    SensorRange("gps", 1, [1.0, 1.0, 2.0, 0.1, 0.1, 0.2], -1e5, 1e5),
    SensorRange("airspeed", 1, 0.02, -50.0, 50.0),
)


def signal(step: int, values: int) -> np.ndarray:
    """A sample that differs in every step and every quantity."""
    return np.sin(0.01 * step + np.arange(values)) + 2.0


class Bench:
    """One aircraft with sensors of which each has a sample in every `every`-th step."""

    def __init__(self, every: int = 1) -> None:
        self.failures: Failures = new_failures(RANGES, [3], 1, STEP_US)
        self.every = every

    def set(
        self,
        sensor: SensorName,
        kind: str,
        value: float = 0.0,
        window: tuple[float, float] = (0.01, math.nan),
        instance: int = 0,
        axis: int = 0,
    ) -> None:
        fault = Fault(
            SENSOR_FAULTS.named(sensor), KINDS[kind], value, *window, instance=instance, axis=axis
        )
        fault_table(self.failures, 0).set([fault], now_s=0.0)

    def run(self, unit: int, steps: int, twice: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return what is reported in each step, and whether it is."""
        n = int(self.failures.units[0, unit]["values"])
        values, fresh = np.zeros((steps, n)), np.zeros(steps, bool)
        for step in range(steps):
            for _ in range(1 + twice):
                values[step] = signal(step, n)
                has, t = step % self.every == 0, step * STEP_US / 1e6
                fresh[step] = fail(self.failures, 0, unit, step, t, values[step], has)
        return values, fresh


def healthy(steps: int, values: int) -> np.ndarray:
    return np.array([signal(step, values) for step in range(steps)])


def test_without_a_fault_samples_pass() -> None:
    values, fresh = Bench(every=4).run(GPS, 40)
    assert np.array_equal(values, healthy(40, 6))
    assert np.array_equal(fresh, np.arange(40) % 4 == 0)


def test_off_reports_nothing_within_its_window() -> None:
    bench = Bench()
    bench.set("airspeed", "off", window=(0.01, 0.02))
    _, fresh = bench.run(PITOT, 40)
    assert list(np.flatnonzero(~fresh)) == list(range(11, 21))  # (start, end]


def test_stuck_repeats_the_last_healthy_sample() -> None:
    bench = Bench()
    bench.set("gyro", "stuck", window=(0.01, 0.02))
    values, fresh = bench.run(GYRO_1, 40)
    expected = healthy(40, 3)
    expected[11:21] = expected[10]
    assert fresh.all()
    assert np.array_equal(values, expected)


def test_garbage_is_uniform_within_the_range_and_differs() -> None:
    bench = Bench()
    bench.set("gyro", "garbage")
    values, _ = bench.run(GYRO_1, 4000)
    garbage = values[11:]
    assert np.abs(garbage).max() <= 35.0
    assert np.abs(garbage.mean(axis=0)).max() < 1.5  # 4.7 standard errors of a uniform mean
    assert garbage.std(axis=0) == pytest.approx(np.full(3, 70.0 / math.sqrt(12.0)), rel=0.05)
    assert np.abs(np.corrcoef(garbage.T)[np.triu_indices(3, 1)]).max() < 0.08
    other, _ = bench.run(GYRO_2, 4000)
    assert not np.any(other[11:] == garbage)


def test_a_bias_is_one_of_its_axis_and_in_its_unit() -> None:
    bench = Bench()
    bench.set("gyro", "bias", 3.0, instance=2, axis=2)
    second, first = bench.run(GYRO_2, 40)[0], bench.run(GYRO_1, 40)[0]
    assert np.array_equal(first, healthy(40, 3))
    added = second - healthy(40, 3)
    assert np.all(added[:11] == 0.0)
    assert added[11:] == pytest.approx(np.tile([0.0, math.radians(3.0), 0.0], (29, 1)))


def test_pressure_is_biased_in_pascal_and_reported_in_hectopascal() -> None:
    bench = Bench()
    bench.set("airspeed", "bias", -50.0)
    assert bench.run(PITOT, 20)[0][15] == pytest.approx(signal(15, 1) - 0.5)


def test_a_drift_grows_from_its_start() -> None:
    bench = Bench()
    bench.set("gps", "drift", 100.0)
    added = bench.run(GPS, 60)[0] - healthy(60, 6)
    assert added[60 - 1] == pytest.approx([4.9] * 3 + [0.0] * 3)


def test_scale_fade_and_range() -> None:
    scaled, faded, wide = Bench(), Bench(), Bench()
    scaled.set("airspeed", "scale", 0.5)
    faded.set("airspeed", "fade", 0.2)
    wide.set("gyro", "scale", 100.0)
    assert scaled.run(PITOT, 20)[0][15] == pytest.approx(0.5 * signal(15, 1))
    shown = faded.run(PITOT, 400)[0][:, 0]
    assert shown[110] == pytest.approx(0.5 * signal(110, 1)[0])
    assert np.all(shown[211:] == 0.0)
    assert np.all(wide.run(GYRO_1, 40)[0][11:] == 35.0)  # saturated


def test_noise_is_as_many_times_larger() -> None:
    bench = Bench()
    bench.set("gyro", "noise", 10.0)
    added = bench.run(GYRO_1, 6000)[0] - healthy(6000, 3)
    own = np.random.default_rng(1).normal(0.0, 0.01, 5989)  # what the sample has already
    for axis in added[11:].T:
        assert np.std(axis + own) == pytest.approx(0.1, rel=0.05)
        assert abs(np.mean(axis)) < 0.006


def test_a_slow_sensor_reports_one_sample_in_ten() -> None:
    bench = Bench(every=2)
    bench.set("gps", "slow", 10.0)
    values, fresh = bench.run(GPS, 200)
    assert list(np.flatnonzero(fresh[11:]) + 11) == list(range(12, 200, 20))
    assert np.array_equal(values[fresh], healthy(200, 6)[fresh])


def test_delayed_samples_come_late_and_none_is_lost() -> None:
    bench = Bench(every=3)
    bench.set("gps", "delayed", 0.02)
    values, fresh = bench.run(GPS, 200)
    sampled = [step for step in range(11, 180) if step % 3 == 0]
    reported = np.flatnonzero(fresh[11:]) + 11
    assert list(reported) == [step + 20 for step in sampled]
    assert np.array_equal(values[reported], healthy(200, 6)[sampled])


def test_an_intermittent_sensor_is_off_in_first_halves() -> None:
    bench = Bench()
    bench.set("airspeed", "intermittent", 50.0)
    _, fresh = bench.run(PITOT, 91)
    phase = (np.arange(11, 91) - 10) % 20
    away = np.abs(phase % 10 - 0) > 0  # not at an edge, where rounding decides
    assert np.array_equal(fresh[11:][away], (phase >= 10)[away])


@pytest.mark.parametrize("kind", KINDS)
def test_a_second_call_for_the_same_step_makes_the_same(kind: str) -> None:
    value = {"delayed": 0.02, "intermittent": 20.0, "slow": 7.0, "noise": 3.0, "fade": 1.0}
    once, twice = Bench(every=2), Bench(every=2)
    for bench in (once, twice):
        bench.set("gyro", kind, value.get(kind, 0.7), window=(0.03, 0.1))
    one, again = once.run(GYRO_1, 200), twice.run(GYRO_1, 200, twice=True)
    assert np.array_equal(one[1], again[1])
    assert np.array_equal(one[0][one[1]], again[0][one[1]])
    assert not np.array_equal(one[0][30:102], healthy(200, 3)[30:102]) or not one[1][30:102:2].all()


def test_a_sensor_is_well_after_its_fault() -> None:
    for kind in KINDS.values():
        bench = Bench()
        bench.set("gyro", kind.name, 0.5 if kind.name != "noise" else 5.0, window=(0.03, 0.1))
        values, fresh = bench.run(GYRO_1, 200)
        assert fresh[101:].all()
        assert np.array_equal(values[101:], healthy(200, 3)[101:])

"""A trigger must not send more than a clock that tracks as well, in noise and in gusts."""

import pytest

from benchmarks.trigger_or_clock import fly, scenario_with
from gcs.lab.baselines.senders import worst_ratio

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("hardware", ["ideal", "realistic", "cheap_imu"])
@pytest.mark.parametrize("turbulence", ["light", "moderate"])
def test_scaled_thresholds_send_less_than_a_clock_that_tracks_no_better(
    hardware: str, turbulence: str
) -> None:
    scaled = fly(scenario_with("surviving", "scaled", hardware, turbulence))
    clock = scenario_with("surviving", "periodic", hardware, turbulence)
    periodic = clock.trigger.model_copy(update={"period_s": 0.05})
    by_clock = fly(clock.model_copy(update={"trigger": periodic}))
    assert sum(u.events for u in scaled.uavs) < 0.9 * sum(u.events for u in by_clock.uavs)
    ratio = worst_ratio(scaled, by_clock)
    assert ratio is not None
    assert ratio < 1.15


@pytest.mark.parametrize("hardware", ["realistic", "cheap_imu"])
def test_noise_is_not_counted(hardware: str) -> None:
    counts = {
        mode: sum(
            uav.events for uav in fly(scenario_with("surviving", mode, hardware, "moderate")).uavs
        )
        for mode in ("per_channel", "scaled")
    }
    assert counts["scaled"] < counts["per_channel"] / 4

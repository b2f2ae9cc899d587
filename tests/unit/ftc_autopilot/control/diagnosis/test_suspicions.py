"""Each condition of a suspicion, just inside and just outside its limit."""

from typing import Any

import numpy as np
import pytest
from actuators import DT, GAINS, LIMITS, SMOOTH, actuator_with, shown

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.control.diagnosis.decisions import phase_of
from ftc_autopilot.control.diagnosis.parameters import Limits
from ftc_autopilot.control.diagnosis.suspicions import monitor, stop_suspected, watch_stop


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("sigma", "threshold"), [(0.0, 2.0), (0.3, 2.0), (0.5, 2.5)])
def test_a_jump_counts_beyond_threshold_and_noise(
    side: float, sigma: float, threshold: float
) -> None:
    known: dict[str, Any] = {"mean": 0.7, "smooth": 0.7, "drift_mean": 0.7, "variance": sigma**2}
    assert phase_of(shown(0.7 + side * 0.99 * threshold, **known)) == HEALTHY
    raised = shown(0.7 + side * 1.01 * threshold, long_var_u=9.0, long_cov=-5.0, **known)
    assert phase_of(raised) == SUSPECT
    assert raised["dither_sign"] == -side
    times = [raised[name] for name in ("suspect_s", "holdoff_s", "cooldown_s", "blanking_s")]
    assert times == pytest.approx([0.6 - DT, 0.25 - DT, 3.1 - DT, 0.015])
    forgotten = 0.1 * (1.0 - DT / 0.3)
    assert [raised["long_var_u"], raised["long_cov"]] == pytest.approx(
        [9.0 * forgotten, -5.0 * forgotten]
    )


@pytest.mark.parametrize(("sigma", "threshold"), [(0.0, 0.5), (0.1, 0.5), (0.2, 0.7)])
def test_a_smoothed_jump_counts_beyond_threshold_and_noise(sigma: float, threshold: float) -> None:
    for side in (1.0, -1.0):
        for share, phase in ((0.99, HEALTHY), (1.01, SUSPECT)):
            away = side * share * threshold
            found = shown(away, limits=SMOOTH, smooth=away, smooth_variance=sigma**2)
            assert phase_of(found) == phase


def test_the_residual_is_smoothed_over_15_ms() -> None:
    assert shown(1.5, smooth=0.3)["smooth"] == pytest.approx(0.3 + DT / 0.015 * 1.2)


@pytest.mark.parametrize(
    ("fields", "age"),
    [({"lost": 1}, 3.0), ({"holdoff_s": 1e-4}, 3.0), ({"blanking_s": 0.004}, 3.0), ({}, 0.0999)],
)
def test_a_jump_that_may_not_count(fields: dict[str, Any], age: float) -> None:
    found = shown(3.0, age, **fields)
    assert found["suspect_s"] == 0.0
    assert found["holdoff_s"] == 0.0
    assert phase_of(shown(3.0, 0.1001)) == SUSPECT


@pytest.mark.parametrize(
    ("smoothed", "cooldown_s", "phase"),
    [
        (0.6, 0.0, SUSPECT),
        (0.6, 1e-3, HEALTHY),  # slight: the whole cooldown
        (1.2, 0.499, SUSPECT),  # clear: 0.5 s less
        (1.2, 0.501, HEALTHY),
    ],
)
def test_no_suspicion_is_raised_in_a_cooldown(
    smoothed: float, cooldown_s: float, phase: int
) -> None:
    found = shown(smoothed, limits=SMOOTH, smooth=smoothed, cooldown_s=cooldown_s)
    assert phase_of(found) == phase
    assert found["blanking_s"] == pytest.approx(0.015)  # of the measurement, all the same


def test_a_jump_blanks_the_measurement_until_its_filter_has_passed() -> None:
    for r, limits, steps in ((9.0, LIMITS, 15), (0.6, SMOOTH, 5)):  # clear, and slight
        actuator = shown(r, limits=limits, smooth=r)
        left = 0
        while actuator["blanking_s"] > 0.0:
            assert actuator["mean"] != pytest.approx(r, rel=1e-3)
            monitor(actuator, limits, 3.0, DT, GAINS)
            assert (actuator["samples"], actuator["var_u"]) == (0.0, 0.0)
            left += 1
        assert left in {steps, steps + 1}
        assert actuator["mean"] == actuator["smooth"] == pytest.approx(r)
        monitor(actuator, limits, 3.0, DT, GAINS)
        assert actuator["samples"] == 1.0


@pytest.mark.parametrize(("age", "memory_s"), [(0.05, 0.1), (2.0, 2.0), (9.0, 5.0)])
def test_mean_and_variance_of_the_residual(age: float, memory_s: float) -> None:
    known: dict[str, Any] = {"mean": 0.2, "smooth": 0.8, "drift_mean": 0.5}
    found = shown(1.7, age, variance=0.5, smooth_variance=0.25, **known)
    smooth = 0.8 + DT / 0.015 * 0.9
    assert found["mean"] == pytest.approx(0.2 + DT / 0.15 * 1.5)
    assert found["variance"] == pytest.approx(0.5 + DT / memory_s * (1.5**2 - 0.5))
    by_smooth = 0.25 + DT / memory_s * ((smooth - 0.2) ** 2 - 0.25)
    assert found["smooth_variance"] == pytest.approx(by_smooth)


def test_a_jump_counts_as_noise_up_to_its_threshold() -> None:
    far = shown(-9.0, lost=1, variance=1.0)
    assert far["variance"] == pytest.approx(1.0 + DT / 3.0 * (5.0**2 - 1.0))
    far = shown(-9.0, limits=SMOOTH, smooth=-9.0, lost=1, smooth_variance=1.0)
    assert far["smooth_variance"] == pytest.approx(1.0 + DT / 3.0 * (3.5**2 - 1.0))


def test_what_a_suspect_actuator_shows_is_no_noise() -> None:
    found = shown(1.5, variance=0.5, smooth_variance=0.25, suspect_s=0.3)
    assert (found["variance"], found["smooth_variance"]) == (0.5, 0.25)
    before = shown(1.5, variance=0.5, smooth_variance=0.25, limits=LIMITS._replace(check=3.1))
    assert before["variance"] == 0.5
    assert before["smooth_variance"] < 0.25


def explained(away: float, age: float = 3.0) -> np.void:
    """An actuator whose command explains 0.4° of the smoothed residual, for 1° of it."""
    moments: dict[str, Any] = {"moved_cov": 0.4, "moved_var_u": 1.0 - 0.4**2}
    command: dict[str, Any] = {"smooth_u": 0.6, "command_mean": -0.4}
    return shown(away, age, SMOOTH, smooth=away, **moments, **command)


def test_what_the_command_explains_is_no_jump() -> None:
    for away, phase in ((0.89, HEALTHY), (0.91, SUSPECT), (-0.09, HEALTHY), (-0.11, SUSPECT)):
        assert phase_of(explained(away)) == phase
    for away, phase in ((0.49, HEALTHY), (0.51, SUSPECT), (-0.49, HEALTHY)):
        assert phase_of(explained(away, age=1.999)) == phase
    known: dict[str, Any] = {"moved_cov": 0.8, "moved_var_u": 1.0 - 0.4**2, "command_mean": -0.4}
    against = shown(0.2, limits=SMOOTH, smooth=0.2, smooth_u=0.6, **known)
    assert phase_of(against) == SUSPECT
    assert against["dither_sign"] == 1.0  # against what it does not explain, -0.6°


@pytest.mark.parametrize(("smooth_jump", "moved"), [(np.inf, 0.66), (0.5, 0.5)])
def test_what_the_command_explains_is_learnt_beside_the_variance(
    smooth_jump: float, moved: float
) -> None:
    known: dict[str, Any] = {"mean": 0.2, "smooth": 0.8, "smooth_u": 1.05, "command_mean": 0.3}
    known["holdoff_s"] = 0.1  # so that it raises no suspicion
    moments: dict[str, Any] = {"moved_var_u": 0.9, "moved_cov": -0.7}
    limits = LIMITS._replace(smooth_jump=smooth_jump)
    found = shown(1.7, 3.0, limits, **known, **moments)
    u = 1.05 + DT / 0.015 * (0.6 - 1.05)
    assert found["smooth_u"] == pytest.approx(u)
    assert found["command_mean"] == pytest.approx(0.3 + DT / 0.15 * (0.6 - 0.3))
    assert found["moved_var_u"] == pytest.approx(0.9 + DT / 3.0 * ((u - 0.3) ** 2 - 0.9))
    assert found["moved_cov"] == pytest.approx(-0.7 + DT / 3.0 * (moved * (u - 0.3) + 0.7))
    for other in ({"suspect_s": 0.3}, {"lost": 1.0}):
        found = shown(1.7, 3.0, limits, **known | moments | other)
        assert [found[name] for name in moments] == list(moments.values())


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_drift_counts_beyond_1_6_thresholds(side: float) -> None:
    def drifted(by: float, age: float = 3.0, **fields: Any) -> np.void:
        r = 0.4 + side * by * 2.0
        return shown(r, age, drift_mean=0.4, mean=r, smooth=r, **fields)

    assert phase_of(drifted(1.59)) == HEALTHY
    raised = drifted(1.61)
    assert phase_of(raised) == SUSPECT
    assert raised["dither_sign"] == -side
    assert raised["drift_mean"] == pytest.approx(0.4 + DT / 4.0 * side * 3.22)
    assert phase_of(drifted(1.61, lost=1)) == LOST
    assert drifted(1.61, lost=1)["suspect_s"] == 0.0
    assert phase_of(drifted(1.61, 1.499)) == HEALTHY
    assert phase_of(drifted(1.61, cooldown_s=0.01)) == HEALTHY


def test_the_slow_mean_follows_at_once_for_a_second() -> None:
    for age, known in ((0.999, 1.0), (1.001, DT / 4.0)):
        found = shown(1.5, age, drift_mean=-0.5)
        assert found["drift_mean"] == pytest.approx(-0.5 + known * 2.0)


def test_swings_are_counted_when_the_side_changes() -> None:
    limits = LIMITS._replace(jump=50.0)
    actuator = actuator_with()
    counted = 0.0
    for k, (r, more) in enumerate([(1.6, 1), (1.7, 0), (-1.4, 0), (-1.6, 1), (-9.0, 0), (1.51, 1)]):
        actuator["measured"] = actuator["smooth"] = r
        actuator["mean"] = 0.0
        monitor(actuator, limits, 3.0 + k * DT, DT, GAINS)
        counted += more - DT / 1.5 * counted
        assert actuator["swings"] == pytest.approx(counted)
        assert actuator["side"] == (1.0 if k in {0, 1, 2, 5} else -1.0)
    early = actuator_with(measured=2.0, smooth=2.0)
    monitor(early, limits, 1.499, DT, GAINS)
    assert early["swings"] == 0.0


def test_each_actuator_is_checked_once_after_the_start() -> None:
    limits = LIMITS._replace(check=0.06)
    for r, sign in ((0.5, -1.0), (0.0, -1.0), (-0.5, 1.0)):
        actuator, suspected = actuator_with(measured=r), []
        for k in range(1, 100):
            monitor(actuator, limits, k * DT, DT, GAINS)
            suspected.append(phase_of(actuator) == SUSPECT)
            if k == 60:
                assert actuator["samples"] == 0.0
                assert actuator["suspect_s"] == pytest.approx(0.6)
        assert suspected.index(True) in {59, 60}
        assert actuator["dither_sign"] == sign
        assert actuator["suspect_s"] == pytest.approx(0.6 - 0.039, abs=1.1e-3)


def test_only_a_jump_has_a_tail() -> None:
    """Movements after a drift, at the control check or at the stop are judged without one."""
    assert shown(2.1)["z_tail"] == 1.0
    assert shown(0.6, limits=SMOOTH, smooth=0.6)["z_tail"] == 1.0
    drifted = shown(3.3, mean=3.3, smooth=3.3)
    checked = shown(0.5, 0.06, LIMITS._replace(check=0.06))
    for without in (drifted, checked, stopped(9.0, 101, z_tail=0.3)):
        assert phase_of(without) == SUSPECT
        assert without["z_tail"] == 0.0


# the stop test


def stopped(
    r: float, steps: int, at_stop: bool = True, limits: Limits = LIMITS, **fields: float
) -> np.void:
    actuator = actuator_with(effectiveness=0.5, commanded=30.0, measured=15.0 + r, **fields)
    for _ in range(steps):
        watch_stop(actuator, limits, at_stop, DT, GAINS)
    return actuator


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_large_residual_at_the_stop_is_suspected_after_100_ms(side: float) -> None:
    """Whatever the cooldown."""
    assert phase_of(stopped(side * 2.01, 99, cooldown_s=2.0)) == HEALTHY
    raised = stopped(side * 2.01, 101, cooldown_s=2.0)
    assert phase_of(raised) == SUSPECT
    assert stop_suspected(raised, GAINS)
    assert raised["dither_sign"] == -side
    assert raised["suspect_s"] == 0.6
    raised["suspect_s"] = 0.0  # it has ended
    for more, phase in ((299, HEALTHY), (3, SUSPECT)):
        for _ in range(more):
            watch_stop(raised, LIMITS, True, DT, GAINS)
        assert phase_of(raised) == phase


def test_the_time_at_the_stop_is_counted_without_a_break() -> None:
    assert stopped(1.99, 200)["stop_s"] == 0.0
    assert stopped(9.0, 200, at_stop=False)["stop_s"] == 0.0
    assert stopped(9.0, 200, lost=1)["stop_s"] == 0.0
    assert stop_suspected(stopped(9.0, 101, suspect_s=0.3), GAINS)  # of another test
    assert stopped(9.0, 99, suspect_s=0.3)["suspect_s"] == 0.3
    actuator = stopped(9.0, 90)
    watch_stop(actuator, LIMITS, False, DT, GAINS)
    assert actuator["stop_s"] == 0.0
    actuator["stop_s"] = -0.15
    watch_stop(actuator, LIMITS, False, DT, GAINS)
    assert actuator["stop_s"] == -0.15


def test_a_residual_as_large_as_when_the_surface_followed_is_the_models() -> None:
    """Within one jump, and of a surface that does not swing."""
    for followed in (7.01, 10.99):
        assert phase_of(stopped(9.0, 200, followed=followed)) == HEALTHY
        assert phase_of(stopped(9.0, 200, followed=followed, swings=0.49)) == HEALTHY
        assert phase_of(stopped(9.0, 200, followed=followed, swings=0.51)) == SUSPECT
    for followed in (6.99, 11.01, -9.0, 0.0):
        assert phase_of(stopped(9.0, 200, followed=followed)) == SUSPECT


@pytest.mark.parametrize(("holdoff_s", "phase"), [(0.01, HEALTHY), (0.0, SUSPECT)])
def test_once_the_residual_is_another_that_it_followed_says_nothing(
    holdoff_s: float, phase: int
) -> None:
    """Unless it is on its way back from the dither."""
    actuator = stopped(9.0, 1, followed=9.0)
    actuator["measured"], actuator["holdoff_s"] = 15.0 + 12.0, holdoff_s
    watch_stop(actuator, LIMITS, True, DT, GAINS)
    actuator["measured"] = 15.0 + 9.0
    for _ in range(200):
        watch_stop(actuator, LIMITS, True, DT, GAINS)
    assert phase_of(actuator) == phase

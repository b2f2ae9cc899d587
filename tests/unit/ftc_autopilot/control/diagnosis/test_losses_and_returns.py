"""Each condition of a loss, of a suspicion that ends and of a return, on each side of its limit."""

import math

import numpy as np
import pytest
from actuators import DT, FILTER_S, GAINS, LIMITS, actuator_with

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.control.diagnosis.decisions import decide, phase_of
from ftc_autopilot.control.diagnosis.instrument import _U, _Y, _Z
from ftc_autopilot.control.diagnosis.parameters import Limits


def decided(
    actuator: np.void,
    steps: int,
    age: float = 3.0,
    limits: Limits = LIMITS,
    is_throttle: bool = False,
) -> int:
    """Phase after decisions whose window and long memory stay as they are."""
    for k in range(steps):
        decide(actuator, 0.0, limits, age + k * DT, DT, GAINS, is_throttle)
    return int(phase_of(actuator))


def flat(**changes: float) -> np.void:
    """A suspect actuator that has not moved while its command did, ρ = 0.09."""
    fields = {"suspect_s": 0.5, "samples": 100.0, "var_u": 1.3**2, "variance": 0.1**2}
    return actuator_with(**fields | changes)


def cov_for(rho: float, var_u: float = 1.3**2, prior: float = 0.4**2) -> float:
    """Covariance with which ρ is found."""
    return rho * (var_u + prior) - prior


LOST_BY: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "excited enough": ({"var_u": 1.21**2}, {"var_u": 1.19**2}),
    "more than the noise": ({"variance": 0.61**2}, {"variance": 0.63**2}),
    "after 6 ms": ({"samples": 7.0}, {"samples": 5.0}),
    "little effect": ({"cov": cov_for(0.199)}, {"cov": cov_for(0.201)}),
    "less than half of what it had": (
        {"cov": cov_for(0.149), "effectiveness": 0.3},
        {"cov": cov_for(0.151), "effectiveness": 0.3},
    ),
    "surely": (
        {"samples": 15.0, "variance": 0.46**2},
        {"samples": 15.0, "variance": 0.47**2},
    ),
    "surely less than half": (  # ρ + 1.5 σ below 0.1 + 0.2
        {"samples": 15.0, "variance": 0.193**2, "effectiveness": 0.2},
        {"samples": 15.0, "variance": 0.194**2, "effectiveness": 0.2},
    ),
    "flat": ({"var_y": 0.111}, {"var_y": 0.112}),  # 2.5² · 0.01 + 0.17² · 1.69
    "flat for its command": (
        {"var_y": 0.67, "variance": 0.4**2},
        {"var_y": 0.68, "variance": 0.4**2},
    ),
    "flat in any noise": (  # that counts up to 0.5°
        {"var_y": 1.82, "variance": 0.6**2, "var_u": 9.0},
        {"var_y": 1.83, "variance": 0.6**2, "var_u": 9.0},
    ),
    "suspect": ({}, {"suspect_s": 0.0}),
}


@pytest.mark.parametrize("name", LOST_BY)
def test_an_actuator_is_lost_within_each_limit(name: str) -> None:
    inside, outside = LOST_BY[name]
    assert decided(flat(**inside), 10) == LOST
    assert decided(flat(**outside), 10) != LOST


def dithered(actuator: np.void, rho: float, error: float, lag: int = 0) -> np.void:
    """Let a dither have shown ρ and its error, by 10 independent samples, at a dead time."""
    moments, z, u = actuator["moments"], _Z + lag, _U + lag
    actuator["z_samples"], actuator["z_s"] = 10 * FILTER_S / DT, 0.1
    for i in (0, 1, 2, z, u):
        moments[i, i] = 1.0
    moments[z, _Y] = moments[u, _Y] = rho
    moments[u, z] = 1.0
    moments[_Y, _Y] = rho**2 + (10 - 3 - 1) * error**2
    return actuator


@pytest.mark.parametrize(
    ("rho", "error", "follows_command", "phase"),
    [
        (0.1, 0.1, False, LOST),
        (0.1, 0.25, False, SUSPECT),
        (0.1, 0.1, True, HEALTHY),  # that is cleared, and no gust in its dither says the contrary
        (-0.5, 0.4, False, LOST),
        (-0.5, 0.2, False, SUSPECT),  # against its dither, by more than its error: a gust
    ],
)
def test_a_dither_that_is_not_followed_is_a_loss_but_for_gusts(
    rho: float, error: float, follows_command: bool, phase: int
) -> None:
    covariance = 1.3**2 if follows_command else cov_for(0.3)
    actuator = flat(cov=covariance, var_y=1.3**2)
    assert decided(dithered(actuator, rho, error), 10) == phase


@pytest.mark.parametrize(
    ("rho", "error", "steps"), [(1.2, 0.25, 16), (0.6, 0.02, 16), (1.4, 0.25, 0), (4.0, 1.4, 0)]
)
def test_no_actuator_does_more_than_its_command_with_a_dead_time(
    rho: float, error: float, steps: int
) -> None:
    """In gusts a dead time was believed with which an aileron had four times its effect."""
    actuator = dithered(actuator_with(suspect_s=0.5), rho, error, lag=2)
    limits = LIMITS._replace(check=5.0)
    found = [decide(actuator, 0.0, limits, 3.0 + k * DT, DT, GAINS, False) for k in range(12)]
    assert phase_of(actuator) == HEALTHY
    assert max(found) == steps


def test_a_loss_is_confirmed_for_8_ms_without_a_break() -> None:
    actuator = flat()
    assert decided(actuator, 7) == SUSPECT
    actuator["var_u"] = 0.5
    assert decided(actuator, 1) == SUSPECT
    actuator["var_u"] = 1.3**2
    assert decided(actuator, 7) == SUSPECT
    assert decided(actuator, 2) == LOST
    assert decided(flat(), 10, 0.045) == SUSPECT  # too soon after the start
    assert decided(flat(), 10, 0.0605) == LOST


def test_a_lost_actuator_is_stuck_where_it_is() -> None:
    fields = {"measured": 4.0, "commanded": 1.0, "offset": 0.5, "effectiveness": 0.8}
    fields |= {"long_var_u": 3.0, "long_cov": 2.0, "long_var_y": 1.0, "quiet_s": 1.0}
    fields |= {"z_tail": 0.5}
    actuator = flat(**fields)
    steps = 0
    while decided(actuator, 1) != LOST:
        steps += 1
    assert steps in {8, 9}
    assert actuator["stuck"] == 4.0
    assert (actuator["offset"], actuator["effectiveness"]) == (0.0, 1.0)
    names = ("decided_s", "confirmed_s", "quiet_s", "suspect_s", "z_s", "z_tail")
    assert [actuator[name] for name in names] == [0.0] * 6
    assert [actuator[f"long_{name}"] for name in ("var_u", "cov", "var_y")] == [0.0] * 3


def following(**changes: float) -> np.void:
    """A suspect actuator that moves as its command does."""
    return flat(cov=1.3**2, var_y=1.3**2, **changes)


CLEARED_BY: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "moved enough": ({"var_u": 0.85**2, "cov": 0.85**2}, {"var_u": 0.83**2, "cov": 0.83**2}),
    "half, less its error": ({"cov": cov_for(0.544)}, {"cov": cov_for(0.541)}),
    "half of what it had": (
        {"cov": cov_for(0.344), "effectiveness": 0.6},
        {"cov": cov_for(0.341), "effectiveness": 0.6},
    ),
    "without swings": (
        {"cov": 1.3**2, "swings": 1.49},
        {"cov": 1.3**2, "swings": 1.51},
    ),
}


@pytest.mark.parametrize("name", CLEARED_BY)
def test_a_suspicion_ends_within_each_limit(name: str) -> None:
    inside, outside = CLEARED_BY[name]
    for changes, phase in ((inside, HEALTHY), (outside, SUSPECT)):
        fields = {"suspect_s": 0.5, "samples": 100.0, "var_u": 1.3**2, "variance": 0.1**2}
        actuator = actuator_with(**fields | {"var_y": 1.3**2} | changes)
        assert decided(actuator, 10) == phase


def test_a_suspicion_ends_after_8_ms_without_a_break() -> None:
    actuator = following(
        holdoff_s=0.2, cooldown_s=2.0, effectiveness=0.5, measured=7.0, commanded=3.0
    )
    assert decided(actuator, 7) == SUSPECT
    actuator["cov"] = 0.0
    decided(actuator, 1)
    actuator["cov"] = 1.3**2
    assert decided(actuator, 7) == SUSPECT
    assert decided(actuator, 2) == HEALTHY
    assert actuator["holdoff_s"] == 0.05
    assert actuator["cooldown_s"] == 2.0
    assert actuator["followed"] == 7.0 - 0.5 * 3.0
    sooner = following(holdoff_s=0.02)
    assert decided(sooner, 10) == HEALTHY
    assert sooner["holdoff_s"] == 0.02


def test_confidence_is_what_the_standard_error_leaves() -> None:
    for variance, left in ((0.0, 1.0), (0.1, None), (100.0, 0.0)):
        actuator = flat(variance=variance)
        decided(actuator, 1)
        expected = 1.0 - math.sqrt(variance / 1.85 / 3.0) if left is None else left
        assert actuator["confidence"] == pytest.approx(expected)


# back in service


def gone(**changes: float) -> np.void:
    """A lost actuator that has followed its probe for long, offset by 9°."""
    fields = {"lost": 1.0, "stuck": 10.0, "measured": 10.0, "commanded": 1.0}
    return actuator_with(
        **fields | {f"long_{x}": 10.0 for x in ("var_u", "cov", "var_y")} | changes
    )


def of_long(var_u: float, cov: float, var_y: float) -> dict[str, float]:
    return {"long_var_u": var_u, "long_cov": cov, "long_var_y": var_y}


RETURNS_BY: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "excited": (of_long(0.37, 0.37, 0.37), of_long(0.35, 0.35, 0.35)),  # 0.25 · 1.2²
    "effect": (of_long(10.0, 5.81, 3.5), of_long(10.0, 5.80, 3.5)),  # 3 · 0.4² of the prior
    "without the prior": (of_long(0.5, 0.2755, 0.2), of_long(0.5, 0.2745, 0.2)),
    "explained": (of_long(10.0, 10.0, 16.6), of_long(10.0, 10.0, 16.7)),  # 60 %
}


@pytest.mark.parametrize("name", RETURNS_BY)
def test_an_actuator_returns_within_each_limit(name: str) -> None:
    inside, outside = RETURNS_BY[name]
    assert decided(gone(**inside), 60) == HEALTHY
    assert decided(gone(**outside), 60) == LOST


def steps_until_returned(actuator: np.void, is_throttle: bool = False) -> int:
    limits = LIMITS._replace(jump=50.0) if is_throttle else LIMITS
    for k in range(1000):
        if decided(actuator, 1, limits=limits, is_throttle=is_throttle) != LOST:
            return k + 1
    return -1


def test_a_return_is_confirmed_for_50_ms() -> None:
    actuator = gone()
    assert steps_until_returned(actuator) in {50, 51}
    assert (actuator["effectiveness"], actuator["offset"]) == pytest.approx((1.0, 9.0))
    assert (actuator["decided_s"], actuator["samples"]) == (0.0, 0.0)
    assert steps_until_returned(gone(decided_s=0.0)) in {299, 300, 301}
    assert steps_until_returned(gone(decided_s=0.0), True) in {349, 350, 351}


def test_a_small_residual_for_half_a_second_is_a_return_of_a_surface() -> None:
    still = of_long(0.0, 0.0, 0.0)
    for side in (1.0, -1.0):
        near = gone(**still, commanded=10.0 + side * 1.49)
        assert steps_until_returned(near) in {569, 570, 571}
        assert steps_until_returned(gone(**still, commanded=10.0 + side * 1.51)) == -1
    assert steps_until_returned(gone(**still, commanded=10.0), True) == -1
    once = gone(**still, commanded=10.0)
    decided(once, 500)
    once["commanded"] = 13.0
    decided(once, 1)
    once["commanded"] = 10.0
    assert steps_until_returned(once) in {569, 570, 571}


def test_where_a_lost_actuator_is_stuck_is_a_mean() -> None:
    actuator = gone(**of_long(0.0, 0.0, 0.0), measured=11.5)
    decided(actuator, 1)
    assert actuator["stuck"] == pytest.approx(10.0 + DT / 0.15 * 1.5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stuck_surface_that_jumps_is_tried_again(side: float) -> None:
    still = of_long(0.0, 0.0, 0.0)
    for measured, is_throttle, decided_s in (
        (10.0 + side * 2.01, False, DT * 0.0),
        (10.0 + side * 1.99, False, 9.0 + DT),
        (10.0 + side * 2.01, True, 9.0 + DT),
    ):
        actuator = gone(**still, measured=measured)
        decided(actuator, 1, is_throttle=is_throttle)
        assert actuator["decided_s"] == pytest.approx(decided_s)
        assert (actuator["z_tail"] > 0.0) == (decided_s == 0.0)


def tried(
    rho: float, seconds: float, noise: float = 0.02, suspect_s: float = 0.0, lately_s: float = 0.0
) -> np.void:
    """An actuator that is moved to and fro by 5°, lost just now or suspect; it rests at 3°."""
    lost = suspect_s == 0.0
    actuator = actuator_with(decided_s=0.0, lost=float(lost), suspect_s=suspect_s, measured=3.0)
    actuator["variance"], actuator["stuck"], actuator["lately_s"] = noise**2, 3.0, lately_s
    random, u, dither = np.random.default_rng(4), 0.0, 0.0
    before = phase_of(actuator)
    for k in range(round(seconds / DT)):
        u += DT / FILTER_S * (dither - u)
        actuator["commanded"] = u
        actuator["measured"] = 3.0 + rho * u + noise * random.standard_normal()
        decide(actuator, dither, LIMITS, 3.0 + k * DT, DT, GAINS, False)
        if phase_of(actuator) != before:
            break
        dither = 5.0 if k * DT % 0.07 < 0.035 else -5.0 * lost
    return actuator


@pytest.mark.parametrize(("rho", "found"), [(0.15, 0.15), (0.5, 0.5), (1.3, 1.0)])
def test_what_is_left_of_an_actuator_just_lost_is_used(rho: float, found: float) -> None:
    actuator = tried(rho, 0.5)
    assert phase_of(actuator) == HEALTHY
    assert actuator["effectiveness"] == pytest.approx(found, abs=0.02)
    assert actuator["offset"] == pytest.approx(3.0, abs=0.4)
    if rho < 1.0:
        by_effect = actuator["measured"] - actuator["effectiveness"] * actuator["commanded"]
        assert actuator["offset"] == pytest.approx(by_effect)
    assert phase_of(tried(rho, 0.19)) == LOST  # it has not been moved twice yet


@pytest.mark.parametrize(("rho", "noise"), [(0.0, 0.02), (0.1, 0.02), (0.2, 1.5)])
def test_an_actuator_with_less_than_is_sure_stays_lost(rho: float, noise: float) -> None:
    actuator = tried(rho, 0.6, noise)
    assert phase_of(actuator) == LOST
    assert actuator["decided_s"] == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("rho", "phase"), [(0.0, LOST), (0.17, LOST), (0.25, SUSPECT), (0.45, SUSPECT), (0.6, HEALTHY)]
)
def test_a_dither_decides_by_what_it_moves(rho: float, phase: int) -> None:
    assert phase_of(tried(rho, 0.3, suspect_s=0.6)) == phase


# running away


def run_away(against: float, away: float, **changes: float) -> np.void:
    """An actuator that is not suspect, whose response has this slope and this residual."""
    var_u = 4.0
    fields = {"samples": 60.0, "var_u": var_u, "cov": cov_for(against, var_u), "var_y": 9.0}
    return actuator_with(**fields | {"measured": away} | changes)


RUNAWAYS: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "far": ({"against": -0.5, "away": 12.1}, {"against": -0.5, "away": 11.9}),
    "to the other side": ({"against": -0.5, "away": -12.1}, {"against": -0.5, "away": -11.9}),
    "from its slow mean": (
        {"against": -0.5, "away": 5.0, "drift_mean": -7.1},
        {"against": -0.5, "away": 13.0, "drift_mean": 1.1},
    ),
    "against its command": ({"against": -0.21, "away": 15.0}, {"against": -0.19, "away": 15.0}),
    "surely": (
        {"against": -0.5, "away": 15.0, "variance": 0.49},
        {"against": -0.5, "away": 15.0, "variance": 0.51},
    ),
    "of no use": ({"against": 0.49, "away": 24.1}, {"against": 0.51, "away": 24.1}),
    "so far away": ({"against": 0.3, "away": 24.1}, {"against": 0.3, "away": 23.9}),
    "excited": (
        {"against": -0.5, "away": 15.0, "var_u": 1.21**2, "cov": cov_for(-0.5, 1.21**2)},
        {"against": -0.5, "away": 15.0, "var_u": 1.19**2, "cov": cov_for(-0.5, 1.19**2)},
    ),
}


@pytest.mark.parametrize("name", RUNAWAYS)
def test_a_surface_that_runs_away_is_lost_within_each_limit(name: str) -> None:
    """Whether it is suspect or not."""
    inside, outside = RUNAWAYS[name]
    assert decided(run_away(**inside), 10) == LOST
    assert decided(run_away(**outside), 10) == HEALTHY


# lost again soon after its return


@pytest.mark.parametrize(
    ("lately_s", "before_s", "care_s", "decided_s"),
    [(4.9, 0.0, 1.0, 0.6), (0.1, 0.0, 1.0, 0.6), (0.1, 2.0, 4.0, 0.6), (0.0, 2.0, 0.0, 0.0)],
)
def test_a_second_loss_soon_after_a_return_is_a_relapse(
    lately_s: float, before_s: float, care_s: float, decided_s: float
) -> None:
    """And each further one doubles the time for which it must be well; a late one begins again."""
    actuator = flat(lately_s=lately_s, patience_s=before_s)
    while decided(actuator, 1) != LOST:
        pass
    assert actuator["care_s"] == actuator["patience_s"] == pytest.approx(care_s)
    assert actuator["decided_s"] == pytest.approx(decided_s)  # no trial, if it is one
    assert actuator["lately_s"] == 5.0


def test_one_that_is_not_back_yet_has_not_been_back_lately() -> None:
    away = gone(lately_s=5.0, **of_long(0.0, 0.0, 0.0))
    decided(away, 9)
    assert away["lately_s"] == 5.0  # it is not back yet


def test_a_relapse_is_over_when_the_actuator_has_long_been_well() -> None:
    actuator = gone(care_s=0.1, stuck=1.0, commanded=10.0)
    assert decided(actuator, 100) == LOST
    assert actuator["care_s"] == pytest.approx(0.0, abs=1e-9)
    actuator["stuck"] = 10.0
    assert steps_until_returned(actuator) in {50, 51, 52}


def test_where_it_sticks_a_command_shows_nothing_of_one_that_comes_and_goes() -> None:
    for away, left_s in ((1.49, 0.5), (-1.51, 0.5 - DT)):
        actuator = gone(care_s=0.5, patience_s=1.0, measured=10.0 + away, commanded=10.0 + away)
        decided(actuator, 1)
        assert actuator["care_s"] == pytest.approx(left_s)


def test_what_is_not_well_counts_ten_times_as_much() -> None:
    for smooth, care_s in ((1.49, 0.5 - DT), (-1.51, 0.5 + 10.0 * DT)):
        actuator = gone(care_s=0.5, patience_s=1.0, smooth=smooth)
        decided(actuator, 1)
        assert actuator["care_s"] == pytest.approx(care_s)
    longest = gone(care_s=2.0, patience_s=2.0, smooth=9.0)
    decided(longest, 3)
    assert longest["care_s"] == 2.0


def test_the_time_lost_is_owed_until_it_has_been_back_for_as_long() -> None:
    actuator = gone(care_s=1.0, patience_s=1.0, owed_s=0.5)
    decided(actuator, 10)
    assert actuator["owed_s"] == pytest.approx(0.5 + 10 * DT)
    for owed_s, left_s in ((0.5, 0.5 - 10 * DT), (0.005, 0.0)):
        back = actuator_with(owed_s=owed_s)
        decided(back, 10)
        assert back["owed_s"] == pytest.approx(left_s)


def test_one_that_comes_and_goes_stays_where_it_sticks() -> None:
    """Not where it is sent while it works, or on the way there, and it is not tried again."""
    nearer = 10.0 + DT / 0.15 * 3.0
    for smooth, u, stuck in ((9.0, 16.1, nearer), (9.0, 15.9, 10.0), (0.0, 16.1, 10.0)):
        actuator = gone(care_s=1.0, smooth=smooth, commanded=u, measured=13.0)
        decided(actuator, 1)
        assert actuator["stuck"] == pytest.approx(stuck)
        assert actuator["decided_s"] == pytest.approx(9.0 + DT)


@pytest.mark.parametrize(("rho", "lately_s"), [(0.3, 0.0), (0.8, 5.0)])
def test_a_weak_actuator_does_not_come_and_go(rho: float, lately_s: float) -> None:
    assert tried(rho, 0.5, lately_s=5.0)["lately_s"] == lately_s

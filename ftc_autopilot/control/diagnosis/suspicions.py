"""Suspicions about one actuator, raised by the residual r = y - u.

- Jump test, of the kind of a CUSUM with a short memory: r, or r smoothed, is farther from its mean
  (EWMA) than a threshold and than a multiple of its standard deviation. Most of the gyro's noise in
  r is fast, as y has the rates' derivative in it: smoothed, r shows jumps several times smaller,
  less the share of r that the command explains where the model is wrong.
- Drift test: r is far from a slower mean. Either one raises a suspicion: the surface is dithered.
- Stop test: the command has been at its stop for a time, and r is large.
- Control check: soon after the start each actuator is suspected once, as what has failed before
  shows by no jump.

Timers keep one event from counting twice: a blanking time in which the filters pass the step, a
hold-off between two jumps, a cooldown between two suspicions. All numbers are fields of
`DiagnosisParameters`. What becomes of a suspicion: `decisions`.
"""

import math

import numpy as np

from ftc_autopilot.control.diagnosis.instrument import restart_instrument
from ftc_autopilot.control.diagnosis.parameters import Limits
from ftc_autopilot.control.diagnosis.regression import learn, restart
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import clamp, square


@compiled
def monitor(actuator: np.void, limits: Limits, age: float, dt: float, gains: np.void) -> None:
    """Test the residual for jumps and drift; learn from it in between.

    After a jump the measurement is blanked until its filter has let the step pass, so that a
    step of the offset is not taken for an actuator that does not follow, and the window restarts.
    A jump that is still slight after a third of that had mostly passed before it was seen.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        limits: Its limits.
        age: Time since the law's first step [s].
        dt: Control period [s].
        gains: Parameters, record made of `DiagnosisParameters`.
    """
    in_service = actuator["lost"] == 0
    u = actuator["commanded"]
    r = actuator["measured"] - actuator["effectiveness"] * u
    away = r - actuator["mean"]
    jump = max(limits.jump, gains["jump_sigma"] * math.sqrt(actuator["variance"]))
    actuator["smooth"] += dt / gains["smooth_s"] * (r - actuator["smooth"])
    actuator["smooth_u"] += dt / gains["smooth_s"] * (u - actuator["smooth_u"])
    whole_away = actuator["smooth"] - actuator["mean"]
    smooth_away = whole_away - _explained(actuator, limits, age, gains)
    smooth_sigma = math.sqrt(actuator["smooth_variance"])
    smooth_jump = max(limits.smooth_jump, gains["smooth_jump_sigma"] * smooth_sigma)
    if age > gains["drift_start_s"]:
        _count_sides(actuator, whole_away, limits.swing, dt, gains)
    slight_jump = gains["slight"] * smooth_jump
    slight = abs(away) <= jump and abs(smooth_away) < slight_jump < gains["slight"] * jump
    rest_of_blanking = (gains["blanking"] - gains["slight_blanking"]) * gains["filter_s"]
    if actuator["blanking_s"] > 0.0:
        actuator["blanking_s"] -= dt
        if slight and actuator["blanking_s"] <= rest_of_blanking:
            actuator["blanking_s"] = 0.0
        restart(actuator)
        if actuator["blanking_s"] <= 0.0:
            actuator["mean"], actuator["smooth"] = r, r
            actuator["command_mean"], actuator["smooth_u"] = u, u
    else:
        jumped = abs(away) > jump or abs(smooth_away) > smooth_jump
        may_count = age > gains["jump_start_s"] and actuator["holdoff_s"] <= 0.0
        if in_service and jumped and may_count:
            actuator["blanking_s"] = gains["blanking"] * gains["filter_s"]
            actuator["holdoff_s"] = gains["holdoff_s"]
            early_s = 0.0 if slight else gains["early_s"]
            _suspect(actuator, limits, smooth_away, early_s, True, gains)
            actuator["long_var_u"] *= gains["remembered"]
            actuator["long_cov"] *= gains["remembered"]
        actuator["mean"] += dt / gains["mean_s"] * away
        if actuator["suspect_s"] == 0.0:  # else r moves because the commands do
            share = dt / clamp(age, gains["first_sigma_s"], gains["sigma_s"])
            if in_service:
                _learn_explained(actuator, clamp(whole_away, -smooth_jump, smooth_jump), share)
            moved = min(abs(smooth_away), smooth_jump)
            actuator["smooth_variance"] += share * (square(moved) - actuator["smooth_variance"])
            if age > limits.check:  # a fault from before the start would pass for noise
                moved = min(abs(away), jump)
                actuator["variance"] += share * (square(moved) - actuator["variance"])
        actuator["command_mean"] += dt / gains["mean_s"] * (u - actuator["command_mean"])
        learn(actuator, limits.window, gains["long_s"], dt)
    actuator["suspect_s"] = max(actuator["suspect_s"] - dt, 0.0)
    blanking_s = actuator["blanking_s"]
    if blanking_s <= limits.ahead or (slight and blanking_s > rest_of_blanking):
        actuator["dither_s"] += dt
    else:
        actuator["dither_s"] = 0.0
    actuator["holdoff_s"] = max(actuator["holdoff_s"] - dt, 0.0)
    actuator["cooldown_s"] = max(actuator["cooldown_s"] - dt, 0.0)
    if age < 1.0:
        actuator["drift_mean"] = r
    drift = r - actuator["drift_mean"]
    actuator["drift_mean"] += dt / gains["drift_mean_s"] * drift
    drifted = abs(drift) > gains["drift"] * jump and age > gains["drift_start_s"]
    if in_service and drifted:
        _suspect(actuator, limits, drift, 0.0, False, gains)
    if age - dt < limits.check <= age:  # what failed before the start shows by no jump
        restart(actuator)  # y and u have risen together with their filters
        _suspect(actuator, limits, -1.0 if r < 0.0 else 1.0, 0.0, False, gains)


@compiled
def _explained(actuator: np.void, limits: Limits, age: float, gains: np.void) -> float:
    """Return how much of the smoothed residual's way from its mean the command explains.

    Where the model is wrong, each movement of the command moves the residual, too: a share of it,
    found by least squares, with a prior of none.
    """
    if age <= gains["explained_start_s"]:
        return 0.0
    share = actuator["moved_cov"] / (actuator["moved_var_u"] + square(limits.prior))
    return float(share * (actuator["smooth_u"] - actuator["command_mean"]))


@compiled
def _learn_explained(actuator: np.void, moved: float, share: float) -> None:
    """Add a movement of the smoothed residual, and the command's, to the moments."""
    u = actuator["smooth_u"] - actuator["command_mean"]
    actuator["moved_cov"] += share * (moved * u - actuator["moved_cov"])
    actuator["moved_var_u"] += share * (u * u - actuator["moved_var_u"])


@compiled
def _count_sides(actuator: np.void, away: float, far: float, dt: float, gains: np.void) -> None:
    """Count how often the residual has come to the other side, with exponential forgetting."""
    actuator["swings"] -= dt / gains["swings_s"] * actuator["swings"]
    if abs(away) > far and away * actuator["side"] <= 0.0:
        actuator["side"] = math.copysign(1.0, away)
        actuator["swings"] += 1.0


@compiled
def watch_stop(actuator: np.void, limits: Limits, at_stop: bool, dt: float, gains: np.void) -> None:
    """Suspect an actuator whose command has been at its stop for a time, with a large residual.

    A law that counteracts what a lost surface does ends there, and as the command stands still, no
    other test sees it. The cooldown does not hold: the aircraft may be overturning. A residual that
    was as large when the surface was seen to follow is the wrong model's, and counts no more.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        limits: Its limits.
        at_stop: Whether the command in force is at the actuator's stop.
        dt: Control period [s].
        gains: Parameters, record made of `DiagnosisParameters`.
    """
    if actuator["suspect_s"] > 0.0 and stop_suspected(actuator, gains):
        return
    r = actuator["measured"] - actuator["effectiveness"] * actuator["commanded"]
    unchanged = _is_unchanged(actuator, r, limits, gains)
    counts = at_stop and actuator["lost"] == 0 and abs(r) > limits.jump and not unchanged
    if stop_suspected(actuator, gains):
        actuator["stop_s"] = -gains["stop_holdoff_s"]
    elif not counts:
        actuator["stop_s"] = min(actuator["stop_s"], 0.0)
    if counts:
        actuator["stop_s"] += dt
        if stop_suspected(actuator, gains):
            _suspect(actuator, limits, r, math.inf, False, gains)


@compiled
def _is_unchanged(actuator: np.void, r: float, limits: Limits, gains: np.void) -> bool:
    """Return whether the residual has been about the same since the surface was seen to follow.

    Of one that swings this says nothing: it may have been seen when it went the right way.
    """
    same = (
        abs(r - actuator["followed"]) <= limits.jump and actuator["swings"] < gains["stop_swings"]
    )
    if not same and actuator["holdoff_s"] <= 0.0:
        actuator["followed"] = 0.0
    return bool(same)


@compiled
def stop_suspected(actuator: np.void, gains: np.void) -> bool:
    """Return whether the stop test has raised the last suspicion."""
    return bool(actuator["stop_s"] > gains["stop_s"])


@compiled
def _suspect(
    actuator: np.void,
    limits: Limits,
    away: float,
    early_s: float,
    jumped: bool,
    gains: np.void,
) -> None:
    """Suspect an actuator, unless it was lately: its movements would renew the suspicion.

    No new suspicion is raised for a cooldown, `early_s` less after a clear jump. The surface will
    be dithered against the change of its residual, as the law's own answer moves it; what it does
    then has the tail of the jump in it, if the residual has `jumped`.
    """
    relapses = actuator["lately_s"] > 0.0 and actuator["suspect_s"] == 0.0
    if actuator["cooldown_s"] <= early_s or relapses:
        actuator["dither_sign"], actuator["followed_s"] = -math.copysign(1.0, away), 0.0
        actuator["dither_s"] = 0.0
        actuator["suspect_s"] = limits.suspicion
        actuator["cooldown_s"] = limits.suspicion + gains["cooldown_s"]
        restart_instrument(actuator, jumped)

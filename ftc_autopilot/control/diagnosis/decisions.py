"""Decisions about one actuator: lost, not suspect any more, back in service.

- Excitation test (persistent excitation), then regression on the command, and on the dither alone
  (`instrument`): the command moved enough, and ρ with its standard error is too small: lost; large
  enough: not suspect any more.
- Return test: a lost actuator follows its probe again, or has a share of its power after all. A
  surface that jumps from where it was stuck is tried as one just lost.

A confirmation time keeps noise from deciding. All numbers are fields of `DiagnosisParameters`. What
raises a suspicion: `suspicions`.
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.control.diagnosis.instrument import (
    LAGS,
    MAX_DEAD_S,
    estimate_by_dither,
    lag_steps,
    learn_instrument,
    restart_instrument,
)
from ftc_autopilot.control.diagnosis.parameters import Limits
from ftc_autopilot.control.diagnosis.regression import estimate, long_estimate, restart
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import square

WATCHED = 2.0
"""Cooldowns after a return, in which none holds, and another loss is a relapse."""


@compiled
def phase_of(actuator: np.void) -> int:
    """Return the phase of an actuator: `HEALTHY`, `SUSPECT` or `LOST`."""
    if actuator["lost"] != 0:
        return LOST
    return SUSPECT if actuator["suspect_s"] > 0.0 else HEALTHY


@compiled
def is_in_care(j: int, state: np.void) -> bool:
    """Return whether actuator j comes and goes, and is kept lost until it has long been well.

    Args:
        j: The actuator, number as FTC_ACTUATOR.
        state: Record of dtype `DIAGNOSIS`.
    """
    return bool(state["actuators"][j]["care_s"] > 0.0)


@compiled
def may_be_weak(j: int, gains: np.void, state: np.void) -> bool:
    """Return whether lost surface j is on its trial, and has not jumped: it is not free again.

    Args:
        j: The surface, number as FTC_ACTUATOR.
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`.
    """
    actuator = state["actuators"][j]
    return bool(actuator["decided_s"] < gains["trial_s"] and actuator["z_tail"] == 0.0)


@compiled
def decide(
    actuator: np.void,
    dither: float,
    limits: Limits,
    age: float,
    dt: float,
    gains: np.void,
    is_throttle: bool,
) -> int:
    """Declare an actuator lost, not suspect any more, or back in service; write its confidence.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        dither: The one that is measured now [rad or N].
        limits: Its limits.
        age: Time since the law's first step [s].
        dt: Control period [s].
        gains: Parameters, record made of `DiagnosisParameters`.
        is_throttle: Whether it is the throttle, whose thrust is measured directly.

    Returns:
        Dead time of a surface that the control check has just found [control periods]; else 0.
    """
    is_new = actuator["decided_s"] < gains["trial_s"]
    on_trial = is_new and actuator["lost"] != 0 and not is_throttle
    is_check = age - actuator["z_s"] < limits.check + limits.suspicion  # raised by it
    lags = LAGS if is_check else 1
    found = _estimates(actuator, dither, lags, limits, on_trial, dt, gains, is_throttle)
    actuator["confidence"] = max(0.0, 1.0 - found.error)
    actuator["decided_s"] += dt
    actuator["owed_s"] = max(actuator["owed_s"] + (dt if actuator["lost"] != 0 else -dt), 0.0)
    if actuator["lost"] == 0:
        actuator["lately_s"] = max(actuator["lately_s"] - dt, 0.0)
        seen, dead = _looks_lost(actuator, found, is_check, limits, age, dt, gains)
        confirm = limits.confirm
    else:
        dead = 0
        seen = _looks_well(actuator, found, is_new, limits, dt, gains, is_throttle)
        confirm = gains["return_confirm_s"]
    actuator["confirmed_s"] = actuator["confirmed_s"] + dt if seen else 0.0
    if actuator["confirmed_s"] > confirm:
        _change(actuator, gains)
    return dead


class _Estimates(NamedTuple):
    """Effectiveness of an actuator and its standard error."""

    rho: float  # by the regression on the command
    error: float
    by_dither: float  # by the dither alone
    dither_error: float  # infinite if that is not known
    lag: int  # number of the dead time with which it is that


@compiled
def _estimates(
    actuator: np.void,
    dither: float,
    lags: int,
    limits: Limits,
    on_trial: bool,
    dt: float,
    gains: np.void,
    is_throttle: bool,
) -> _Estimates:
    """Return what is known of the effectiveness; learn from the dither of one that has some."""
    rho, error = estimate(actuator, limits.prior, limits.window, gains["filter_s"], dt)
    if actuator["suspect_s"] == 0.0 and not on_trial:
        return _Estimates(rho, error, 1.0, math.inf, 0)
    lag_s = gains["throttle"]["lag_s"] if is_throttle else gains["servo_lag_s"]
    memory_s = gains["trial_s"] if on_trial else gains["dither_memory_s"]
    learn_instrument(actuator, dither, lags, lag_s, gains["filter_s"], memory_s, dt)
    by_dither, dither_error, lag = estimate_by_dither(actuator, lags, gains["filter_s"], dt)
    return _Estimates(rho, error, by_dither, dither_error, lag)


@compiled
def _looks_lost(
    actuator: np.void,
    found: _Estimates,
    is_check: bool,
    limits: Limits,
    age: float,
    dt: float,
    gains: np.void,
) -> tuple[bool, int]:
    """Return whether a working actuator seems lost, and its dead time; end a suspicion."""
    dead = 0
    r = actuator["measured"] - actuator["effectiveness"] * actuator["commanded"]
    enough = max(limits.excitation, gains["excitation_sigma"] * math.sqrt(actuator["variance"]))
    long_enough = actuator["samples"] * dt > gains["least_window_s"]
    moved = math.sqrt(actuator["var_u"]) if long_enough else 0.0
    follows = _follows_command(found, moved > gains["cleared_excitation"] * enough, actuator, gains)
    if follows or _follows_dither(found, actuator, gains):
        actuator["followed_s"] += dt
    else:
        actuator["followed_s"] = 0.0
    if actuator["followed_s"] > limits.confirm and actuator["suspect_s"] > 0.0:
        actuator["suspect_s"] = 0.0
        actuator["followed"] = r
        actuator["holdoff_s"] = min(actuator["holdoff_s"], gains["cleared_holdoff_s"])
        if is_check:
            actuator["cooldown_s"] = 0.0
            dead = lag_steps(found.lag, dt) if _shows_dead_time(found, actuator, gains) else 0
    may_be = (
        age > gains["loss_start_s"]
        and not (is_check and actuator["z_s"] < MAX_DEAD_S + limits.confirm)
        and not follows  # gusts make a few periods of a dither say anything
    )
    later = is_check and found.by_dither > gains["following"] * actuator["effectiveness"]
    excited = moved > enough and not later  # after a dead time that is not known yet
    runs = moved > enough and _runs_away(actuator, found, r, limits, gains)
    return may_be and (runs or _is_lost(found, excited, actuator, limits, gains)), dead


@compiled
def _looks_well(
    actuator: np.void,
    found: _Estimates,
    is_new: bool,
    limits: Limits,
    dt: float,
    gains: np.void,
    is_throttle: bool,
) -> bool:
    """Return whether a lost actuator seems to work; a trial may return it with a share at once."""
    moved = actuator["measured"] - actuator["stuck"]
    if actuator["care_s"] > 0.0:
        _take_care(actuator, moved, limits, dt, gains)
        return False
    may_return = actuator["decided_s"] > gains["return_start_s"]
    arrived = may_return and not is_throttle and _has_arrived(actuator, moved, limits, gains)
    jumped = abs(moved) > limits.jump and not arrived
    if not is_throttle and not is_new and jumped:  # it may be free again
        actuator["decided_s"] = 0.0
        restart_instrument(actuator, True)
    actuator["stuck"] += dt / gains["mean_s"] * moved
    small = abs(actuator["measured"] - actuator["commanded"]) < gains["quiet"] * limits.jump
    actuator["quiet_s"] = actuator["quiet_s"] + dt if small else 0.0
    seen = arrived or (may_return and _follows(actuator, limits, gains, is_throttle))
    on_trial = is_new and not is_throttle and actuator["decided_s"] > gains["trial_least_s"]
    least = max(gains["weak_effectiveness"], gains["weak_sigma"] * found.dither_error)
    if on_trial and found.by_dither > least:
        _change(actuator, gains)
        actuator["effectiveness"] = min(found.by_dither, 1.0)
        if found.by_dither < gains["following"]:  # it is weak, and was so all the time
            actuator["lately_s"] = actuator["owed_s"] = 0.0
        actuator["offset"] = actuator["measured"] - found.by_dither * actuator["commanded"]
        seen = False
    return bool(seen)


@compiled
def _take_care(actuator: np.void, moved: float, limits: Limits, dt: float, gains: np.void) -> None:
    """Count how long an actuator that was lost again soon after its return has been well.

    The others go on as if it stuck, well or not, so that its coming and going disturbs nothing. A
    command near to where it sticks tells nothing of it: there both look the same. And where it
    sticks only that tells which is nearer to there than to its command: the rest is seen while it
    follows, or is on the way between the two.
    """
    near = gains["quiet"] * limits.jump
    if abs(actuator["smooth"]) < near:
        if abs(actuator["commanded"] - actuator["stuck"]) > near:
            actuator["care_s"] = max(actuator["care_s"] - dt, 0.0)
    else:
        more = gains["relapse_weight"] * dt
        actuator["care_s"] = min(actuator["care_s"] + more, actuator["patience_s"])
        if abs(moved) < abs(actuator["measured"] - actuator["commanded"]):
            actuator["stuck"] += dt / gains["mean_s"] * moved


@compiled
def _follows_command(found: _Estimates, moved: bool, actuator: np.void, gains: np.void) -> bool:
    """Return whether an actuator follows its command, if that moved.

    One that swings may go along with it by chance: its dither alone clears it.
    """
    by_chance = actuator["swings"] > gains["cleared_swings"]
    following = gains["following"] * actuator["effectiveness"]
    return bool(moved and not by_chance and found.rho - found.error > following)


@compiled
def _follows_dither(found: _Estimates, actuator: np.void, gains: np.void) -> bool:
    """Return whether an actuator follows its dither."""
    following = gains["following"] * actuator["effectiveness"]
    return bool(found.by_dither - gains["cleared_sigma"] * found.dither_error > following)


@compiled
def _shows_dead_time(found: _Estimates, actuator: np.void, gains: np.void) -> bool:
    """Return whether an actuator follows its dither with the dead time found, and not a gust.

    It would do more than it is commanded, were that dead time none of its own.
    """
    plausible = found.by_dither - found.dither_error < actuator["effectiveness"]
    return bool(plausible and _follows_dither(found, actuator, gains))


@compiled
def _is_lost(
    found: _Estimates, excited: bool, actuator: np.void, limits: Limits, gains: np.void
) -> bool:
    """Return whether an actuator does not follow, or with a smaller share than it is known to have.

    Either by the dither alone, which nothing fools but takes some periods, and a gust if they are
    few: one that seems to move against it does not say that it is lost; or at once, if the
    actuator does not move at all while the command does, in a dither. Else a loop that counteracts
    a swinging offset of a working actuator would look the same.
    """
    lost = min(gains["lost_effectiveness"], 0.5 * actuator["effectiveness"])
    surely = lost + gains["lost_margin"] * lost / gains["lost_effectiveness"]
    margin = gains["lost_sigma"] * found.dither_error
    against = -gains["against_sigma"] * found.dither_error
    if against < found.by_dither < min(lost, surely - margin):
        return True
    noise = min(actuator["variance"], square(gains["flat_noise"] * limits.jump))
    flat = square(gains["flat_sigma"]) * noise + square(gains["flat"]) * actuator["var_u"]
    return bool(
        excited
        and found.rho < lost
        and found.rho + gains["lost_command_sigma"] * found.error < surely
        and actuator["var_y"] < min(flat, gains["min_response_ratio"] * actuator["var_u"])
        and actuator["suspect_s"] > 0.0
    )


@compiled
def _runs_away(
    actuator: np.void, found: _Estimates, r: float, limits: Limits, gains: np.void
) -> bool:
    """Return whether a surface has run far away from its command while that went the other way.

    A working one that swings comes back before it is so far away; one with an offset follows what
    counteracts the offset. Twice as far away it is of no use, and not to follow is enough.
    """
    away = abs(r - actuator["drift_mean"])
    at_most = found.rho + gains["lost_command_sigma"] * found.error
    against = away > limits.runaway and at_most < -gains["runaway_against"]
    useless = (
        away > 2.0 * limits.runaway and at_most < gains["following"] * actuator["effectiveness"]
    )
    return bool(against or useless)


@compiled
def _has_arrived(actuator: np.void, moved: float, limits: Limits, gains: np.void) -> bool:
    """Return whether a lost surface has jumped most of the way to a command far away from it."""
    way = actuator["commanded"] - (actuator["measured"] - moved)
    is_far = abs(way) > gains["return_way"] * limits.jump
    return bool(is_far and moved / way > gains["return_effectiveness"])


@compiled
def _follows(actuator: np.void, limits: Limits, gains: np.void, is_throttle: bool) -> bool:
    """Return whether a lost actuator follows its command again.

    Its moments over the longer memory say so, or the residual of a surface has been small for so
    long that the probe has moved.
    """
    cov, var_u = actuator["long_cov"], actuator["long_var_u"]
    follows: bool = (
        var_u > 0.25 * square(limits.excitation)
        and long_estimate(actuator, limits.prior) > gains["return_effectiveness"]
        and cov > 0.55 * var_u
        and cov * cov > gains["return_r2"] * var_u * actuator["long_var_y"]
    )
    if not is_throttle:
        return follows or float(actuator["quiet_s"]) > limits.quiet
    settled = float(actuator["decided_s"]) > gains["throttle"]["return_start_s"]
    return follows and settled


@compiled
def _change(actuator: np.void, gains: np.void) -> None:
    """Declare a lost actuator back in service, any other one lost."""
    actuator["decided_s"], actuator["confirmed_s"], actuator["quiet_s"] = 0.0, 0.0, 0.0
    actuator["suspect_s"] = 0.0
    if actuator["lost"] == 0:
        actuator["lost"] = 1
        actuator["stuck"] = actuator["sticks"] = actuator["measured"]
        actuator["offset"], actuator["effectiveness"] = 0.0, 1.0
        actuator["long_var_u"], actuator["long_cov"], actuator["long_var_y"] = 0.0, 0.0, 0.0
        restart_instrument(actuator, False)
        if actuator["lately_s"] > 0.0:
            actuator["patience_s"] = max(2.0 * actuator["patience_s"], gains["relapse_s"])
            actuator["care_s"], actuator["decided_s"] = actuator["patience_s"], gains["trial_s"]
        else:
            actuator["patience_s"] = 0.0
        actuator["lately_s"] = WATCHED * gains["cooldown_s"]
    else:
        actuator["lost"] = 0
        actuator["offset"] = actuator["measured"] - actuator["commanded"]
        actuator["effectiveness"] = 1.0
        restart(actuator)

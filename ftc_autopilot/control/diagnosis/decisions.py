"""Decisions about one actuator: suspect, lost, back in service.

Suspect: the residual r = y - u jumped from its slow mean, or crept away without any excitation.
Most of the gyro's noise in r is fast, since y has the rates' derivative in it; smoothed over 15 ms,
r shows jumps that are several times smaller. Lost: the command moved enough and the actuator did
not follow; if it did, the suspicion ends. Back: a lost one follows again.
"""

import math

import numpy as np

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.control.diagnosis.parameters import Thresholds
from ftc_autopilot.control.diagnosis.regression import estimate, learn, long_estimate, restart
from mavlink_defs.runtime.jit import compiled

_START_S = 0.3  # no jump counts earlier: the aircraft is being trimmed
_DECIDE_S = 0.5  # no loss is declared earlier
_CREEP_S = 1.5
_CENTRE_S, _OLD_CENTRE_S, _NOISE_S = 0.15, 4.0, 5.0  # memories
_FIRST_NOISE_S = 0.1  # that of the noise begins with this, and grows
_SMOOTH_S = 0.015  # filter of the smoothed residual
_BLANK = 1.5  # of the measurement's filters: most of a step has passed it
_SLIGHT_BLANK = 0.5  # likewise, after a jump that is slight
_SLIGHT = 2.0  # of the threshold of a smoothed jump
_LOCK_S = 0.25
_REST_S = 2.5
_EARLY_S = 0.5  # before the end of a rest, when a jump counts again that is not slight
_RETURNS_S = 0.05  # after a suspicion that ended, until the surface is back from its movements
_CREPT = 1.6  # of the threshold of a jump
_KEPT = 0.1  # of the longer memory, after a jump
_MORE_EXCITATION = 2.1  # of the noise
_UNFOLLOWED = 0.4  # var_y by var_u below which an actuator does not follow
_MARGIN = 0.4  # of ρ + 1.5 σ_ρ above the limit of a lost actuator
_FOLLOWING = 0.5  # ρ - σ_ρ above which a suspect actuator follows
_FEW_S = 0.006  # shortest window
_LONG_SETTLE_S = 0.3  # before the longer memory may tell that the throttle is back
_SETTLE_S = 0.25  # after a loss, before a return can be seen: the probe has moved
_BACK_S = 0.05  # for which a return must be seen
_SMALL = 0.75  # residual, of the threshold of a jump
_BACK_EFFECTIVENESS, _BACK_R2 = 0.6, 0.6


@compiled
def phase_of(actuator: np.void) -> int:
    """Return the phase of an actuator: `HEALTHY`, `SUSPECT` or `LOST`."""
    if actuator["lost"] != 0:
        return LOST
    return SUSPECT if actuator["suspect"] > 0.0 else HEALTHY


@compiled
def watch(
    actuator: np.void,
    limits: Thresholds,
    age: float,
    dt: float,
    filter_s: float,
    sigmas: float,
    smooth_sigmas: float,
) -> None:
    """Look for jumps and creeping of the residual; learn from it in between.

    After a jump the measurement is blanked until its filter has let the step pass, so that a
    step of the offset is not taken for an actuator that does not follow, and the window starts
    anew. A jump that is still slight after a third of that had mostly passed before it was seen.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        limits: Its thresholds.
        age: Time since the law's first step [s].
        dt: Control period [s].
        filter_s: Filter of the measurement [s].
        sigmas: Least jump, in standard deviations of the residual's noise.
        smooth_sigmas: The same of the smoothed residual.
    """
    in_service = actuator["lost"] == 0
    r = actuator["measured"] - actuator["commanded"]
    away = r - actuator["centre"]
    jump = max(limits.jump, sigmas * math.sqrt(actuator["noise"]))
    actuator["smooth"] += dt / _SMOOTH_S * (r - actuator["smooth"])
    smooth_away = actuator["smooth"] - actuator["centre"]
    smooth_jump = max(limits.smooth_jump, smooth_sigmas * math.sqrt(actuator["smooth_noise"]))
    slight = abs(away) <= jump and abs(smooth_away) < _SLIGHT * smooth_jump < _SLIGHT * jump
    rest_of_blank = (_BLANK - _SLIGHT_BLANK) * filter_s
    if actuator["blank"] > 0.0:
        actuator["blank"] -= dt
        if slight and actuator["blank"] <= rest_of_blank:
            actuator["blank"] = 0.0
        restart(actuator)
        if actuator["blank"] <= 0.0:
            actuator["centre"], actuator["smooth"] = r, r
    else:
        jumped = abs(away) > jump or abs(smooth_away) > smooth_jump
        if in_service and jumped and age > _START_S and actuator["lock"] <= 0.0:
            actuator["blank"], actuator["lock"] = _BLANK * filter_s, _LOCK_S
            _suspect(actuator, limits, smooth_away, 0.0 if slight else _EARLY_S)
            actuator["long_var_u"] *= _KEPT
            actuator["long_cov"] *= _KEPT
        actuator["centre"] += dt / _CENTRE_S * away
        if actuator["suspect"] == 0.0:  # else r moves because the commands do
            share = dt / min(max(age, _FIRST_NOISE_S), _NOISE_S)  # at first the mean so far
            square, smooth_square = (
                min(abs(away), jump) ** 2,
                min(abs(smooth_away), smooth_jump) ** 2,
            )
            actuator["noise"] += share * (square - actuator["noise"])
            actuator["smooth_noise"] += share * (smooth_square - actuator["smooth_noise"])
        learn(actuator, limits.window, dt)
    actuator["suspect"] = max(actuator["suspect"] - dt, 0.0)
    if actuator["blank"] <= limits.ahead or (slight and actuator["blank"] > rest_of_blank):
        actuator["moving"] += dt
    else:
        actuator["moving"] = 0.0
    actuator["lock"] = max(actuator["lock"] - dt, 0.0)
    actuator["rest"] = max(actuator["rest"] - dt, 0.0)
    if age < 1.0:
        actuator["old_centre"] = r
    crept = r - actuator["old_centre"]
    actuator["old_centre"] += dt / _OLD_CENTRE_S * crept
    if in_service and abs(crept) > _CREPT * jump and age > _CREEP_S:
        _suspect(actuator, limits, crept, 0.0)


@compiled
def _suspect(actuator: np.void, limits: Thresholds, away: float, early_s: float) -> None:
    """Suspect an actuator, unless it was lately: its movements would renew the suspicion.

    It rests for `_REST_S` less `early_s`. It will be moved against the change of its residual, as
    the law's own answer moves it.
    """
    if actuator["rest"] <= early_s:
        actuator["way"], actuator["followed"] = -math.copysign(1.0, away), 0.0
        actuator["moving"] = 0.0
        actuator["suspect"], actuator["rest"] = limits.suspicion, limits.suspicion + _REST_S


@compiled
def decide(
    actuator: np.void,
    limits: Thresholds,
    age: float,
    dt: float,
    filter_s: float,
    lost_effectiveness: float,
    is_throttle: bool,
) -> None:
    """Declare an actuator lost, not suspect any more, or back in service; write its confidence.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        limits: Its thresholds.
        age: Time since the law's first step [s].
        dt: Control period [s].
        filter_s: Filter of the measurement [s].
        lost_effectiveness: An actuator with less is lost.
        is_throttle: Whether it is the throttle, whose thrust tells directly.
    """
    effectiveness, error = estimate(actuator, limits.prior, limits.window, filter_s, dt)
    actuator["confidence"] = max(0.0, 1.0 - error)
    actuator["since"] += dt
    if actuator["lost"] == 0:
        enough = max(limits.excitation, _MORE_EXCITATION * math.sqrt(actuator["noise"]))
        moved = actuator["samples"] * dt > _FEW_S and actuator["var_u"] > enough * enough
        follows = moved and effectiveness - error > _FOLLOWING
        actuator["followed"] = actuator["followed"] + dt if follows else 0.0
        if actuator["followed"] > limits.confirm and actuator["suspect"] > 0.0:
            actuator["suspect"] = 0.0
            actuator["lock"] = min(actuator["lock"], _RETURNS_S)
        seen = (
            age > _DECIDE_S
            and moved
            and effectiveness < lost_effectiveness
            and effectiveness + 1.5 * error < lost_effectiveness + _MARGIN
            and actuator["var_y"] < _UNFOLLOWED * actuator["var_u"]
        )
        confirm = limits.confirm
    else:
        actuator["stuck"] += dt / _CENTRE_S * (actuator["measured"] - actuator["stuck"])
        r = actuator["measured"] - actuator["commanded"]
        small = abs(r) < _SMALL * limits.jump
        actuator["quiet"] = actuator["quiet"] + dt if small else 0.0
        seen = actuator["since"] > _SETTLE_S and _follows(actuator, limits, is_throttle)
        confirm = _BACK_S
    actuator["agreed"] = actuator["agreed"] + dt if seen else 0.0
    if actuator["agreed"] > confirm:
        _change(actuator)


@compiled
def _follows(actuator: np.void, limits: Thresholds, is_throttle: bool) -> bool:
    """Return whether a lost actuator follows its command again.

    Its moments over the longer memory say so, or its residual has been small for so long that the
    probe has moved, or the thrust is that of the command.
    """
    cov, var_u = actuator["long_cov"], actuator["long_var_u"]
    follows: bool = (
        var_u > 0.25 * limits.excitation**2
        and long_estimate(actuator, limits.prior) > _BACK_EFFECTIVENESS
        and cov > 0.55 * var_u
        and cov * cov > _BACK_R2 * var_u * actuator["long_var_y"]
    )
    if not is_throttle:
        return follows or float(actuator["quiet"]) > limits.quiet
    u: float = actuator["commanded"]
    near = abs(actuator["measured"] - u) < 0.5 * limits.jump + 0.1 * u
    gives = bool(near) and u > 0.25 * limits.jump
    return gives or (follows and float(actuator["since"]) > _LONG_SETTLE_S)


@compiled
def _change(actuator: np.void) -> None:
    """Declare a lost actuator back in service, any other one lost."""
    actuator["since"], actuator["agreed"], actuator["quiet"] = 0.0, 0.0, 0.0
    actuator["suspect"] = 0.0
    if actuator["lost"] == 0:
        actuator["lost"] = 1
        actuator["stuck"] = actuator["measured"]
        actuator["offset"], actuator["effectiveness"] = 0.0, 1.0
        actuator["long_var_u"], actuator["long_cov"], actuator["long_var_y"] = 0.0, 0.0, 0.0
    else:
        actuator["lost"] = 0
        actuator["offset"] = actuator["measured"] - actuator["commanded"]
        actuator["effectiveness"] = 1.0
        restart(actuator)

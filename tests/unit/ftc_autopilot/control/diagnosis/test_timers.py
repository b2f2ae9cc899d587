"""No test of the diagnosis sleeps while the timer of another one runs, or its reason is here."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from actuators import DT, GAINS, LIMITS, SMOOTH, actuator_with

from ftc_autopilot.common.phases import HEALTHY, LOST
from ftc_autopilot.control.diagnosis.decisions import decide, phase_of
from ftc_autopilot.control.diagnosis.parameters import Limits
from ftc_autopilot.control.diagnosis.state import ACTUATOR
from ftc_autopilot.control.diagnosis.suspicions import monitor, stop_suspected, watch_stop

TIMERS = {
    "blanking_s": 0.015,
    "holdoff_s": 0.25,
    "suspect_s": 0.5,
    "cooldown_s": 3.0,
    "stop_s": -0.2,
    "lately_s": 5.0,
    "care_s": 1.0,
    "decided_s": 0.0,
}
"""Running timers; of all but the last, which counts up, it is the time that is left [s]."""
COUNTERS = {"z_s", "dither_s", "confirmed_s", "followed_s", "quiet_s", "owed_s", "patience_s"}
"""For how long something has lasted, or must: no test waits for their end."""


class Shown(NamedTuple):
    """What one test is there to see."""

    u: Callable[[float], float]  # [deg] at a time [s]
    y: Callable[[float], float]
    sees: Callable[[np.void], bool]
    fields: dict[str, float] = {}  # noqa: RUF012 - read only
    limits: Limits = LIMITS
    at_stop: bool = False
    lasts_s: float = 0.3


def _is_suspected(actuator: np.void) -> bool:
    return phase_of(actuator) != HEALTHY


def _is_lost(actuator: np.void) -> bool:
    return phase_of(actuator) == LOST


def _stops(actuator: np.void) -> bool:
    return stop_suspected(actuator, GAINS) or _is_lost(actuator)


def _works(actuator: np.void) -> bool:
    return phase_of(actuator) == HEALTHY


def _square(t: float) -> float:
    """Return a command that is moved to and fro, as a servo follows it."""
    return 2.0 * float(np.sin(2.0 * np.pi * t / 0.07))


_AWAY = {"mean": -9.0, "smooth": -9.0, "drift_mean": -9.0}
_GONE = {"lost": 1.0, "stuck": 0.0}
TESTS = {
    "jump": Shown(lambda t: 0.0, lambda t: 3.0 * (t > 0.005), _is_suspected),
    "smoothed jump": Shown(
        lambda t: 0.0, lambda t: 1.5 * (t > 0.005), _is_suspected, limits=SMOOTH
    ),
    "drift": Shown(lambda t: 0.0, lambda t: 3.3, _is_suspected, {"mean": 3.3, "smooth": 3.3}),
    "stop": Shown(lambda t: 30.0, lambda t: 21.0, _stops, _AWAY, at_stop=True),
    "runaway": Shown(lambda t: -250.0 * t, lambda t: 250.0 * t, _is_lost, lasts_s=0.1),
    "flat response": Shown(_square, lambda t: 0.0, _is_lost, {"suspect_s": 0.5}),
    "following": Shown(_square, _square, _works, {"suspect_s": 0.5}),
    "arrival": Shown(lambda t: 9.0, lambda t: 9.0, _works, _GONE | {"suspect_s": 0.0}),
    "quiet": Shown(_square, _square, _works, _GONE, lasts_s=1.0),
}
_PASSES = "a jump passes the filter of the measurement, and nothing is measured until it has"
_ONCE = "one jump would count twice; what is left of a second one shows as a drift"
_RENEWED = "the movements of a suspicion would renew it; not so after a loss (`lately_s`)"
EXCEPTIONS = {
    ("jump", "blanking_s"): _PASSES,
    ("runaway", "blanking_s"): _PASSES,
    ("jump", "holdoff_s"): _ONCE,
    ("smoothed jump", "holdoff_s"): _ONCE,
    ("jump", "cooldown_s"): _RENEWED,
    ("smoothed jump", "cooldown_s"): _RENEWED,
    ("drift", "cooldown_s"): _RENEWED,
    ("stop", "stop_s"): "its own hold-off",
    ("arrival", "decided_s"): "right after a loss the probe has not moved yet",
    ("arrival", "care_s"): "a surface that comes and goes is well only after a time",
    ("quiet", "care_s"): "a surface that comes and goes is well only after a time",
}
"""Tests that see later, or not at all, while a timer runs, and why."""


def steps_until_seen(name: str, timer: str | None) -> int:
    """Return after how many steps a test sees what is shown; -1: never."""
    shown = TESTS[name]
    actuator = actuator_with(**{"variance": 0.2**2, "smooth_variance": 0.04**2} | shown.fields)
    if timer is not None:
        actuator[timer] = TIMERS[timer]
    for k in range(round(shown.lasts_s / DT)):
        actuator["commanded"], actuator["measured"] = shown.u(k * DT), shown.y(k * DT)
        monitor(actuator, shown.limits, 9.0 + k * DT, DT, GAINS)
        watch_stop(actuator, shown.limits, shown.at_stop, DT, GAINS)
        decide(actuator, 0.0, shown.limits, 9.0 + k * DT, DT, GAINS, False)
        if shown.sees(actuator):
            return k + 1
    return -1


@pytest.mark.parametrize("timer", TIMERS)
@pytest.mark.parametrize("name", TESTS)
def test_no_test_sleeps_while_the_timer_of_another_one_runs(name: str, timer: str) -> None:
    alone, beside = steps_until_seen(name, None), steps_until_seen(name, timer)
    assert alone > 0
    sleeps = not 0 < beside <= alone
    assert sleeps == ((name, timer) in EXCEPTIONS), f"alone {alone} steps, beside {beside}"


def test_after_a_loss_no_cooldown_holds() -> None:
    for name in ("jump", "smoothed jump", "drift"):
        shown = TESTS[name]
        relapsing = shown._replace(fields=shown.fields | {"lately_s": 5.0})
        TESTS["relapse"] = relapsing
        assert steps_until_seen("relapse", "cooldown_s") == steps_until_seen(name, None)
        del TESTS["relapse"]


def test_every_timer_is_in_one_of_the_lists() -> None:
    times = {name for name in ACTUATOR.names or () if name.endswith("_s")}
    assert times == set(TIMERS) | COUNTERS

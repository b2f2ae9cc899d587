"""The pitot tube against the lift that carries the aircraft.

L = (ρ V²/2) S (cL0 + cL_alpha α) of the nominal aircraft: what the dynamic pressure that the tube
shows would carry, over what is carried, is 1, or the aircraft's own ratio, which is learned; of a
tube that ices up, leaks or is blocked it falls with its pressure.

A vertical gust w changes α by w/V, and the lift by half of it where that is a few degrees. So the
ratio is one of two means, which a gust leaves unbiased, as it would not leave a logarithm; over
several times, as gusts average out and ice stays; and each has the limit that its own scatter
gives, at the odds of `gate_sigma`, as any sensor. The scatter is learned from how the short mean
moves about the longer one, which neither ice nor a wrong model does. Where the limit is larger than
all that a tube can do, the lift says nothing, and nobody is blamed by it.
"""

import math
from typing import Final

import numpy as np

from ftc_autopilot.estimation.alignment import STALLED
from ftc_autopilot.estimation.measurements import SETTLING_S, column
from ftc_autopilot.estimation.state import VEL, WIND, rotation
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import dot, square

SHORT: Final = 0
LONG: Final = 1
FLIGHT: Final = 2
"""Means: of 0.4 s, of `icing_mean_s`, of what was learned."""
CARRIED: Final = 0
LIFT: Final = 1
SHOWN: Final = 2
EXPECTED: Final = 3
"""What the tube's pressure would carry, what is carried [m/s²]; pressure, and by the wind [Pa]."""

AIRSPEED = np.dtype(
    [
        ("age", "f8"),  # for which it has learned [s]
        ("wind", "f8", (2,)),  # mean wind, north and east [m/s]
        ("gusts", "f8", (2,)),  # mean square of what it differs from that [m²/s²]
        ("means", "f8", (3, 4)),  # by the numbers above; zero: nothing is known
        ("scatter", "f8"),  # variance of the ratio by gusts, seen so far
        ("slope", "f8"),  # of the ratio by a vertical wind [s/m]
        ("suspicious", "f8"),  # for which wind and lift have spoken against the tube [s]
        ("excess", "f8"),  # mean of the filter's `gusts`, while the wind is near its mean
        ("unknown", "f8"),  # mean variance of the wind along the x axis [m²/s²]
    ]
)
"""What the test of the pitot tube remembers."""

_SHORT_S = 0.4
_MODEL_S = 60.0  # in which the model's errors are learned
_BELIEVED_S = 5.0  # of flight, that the model counts for at the least
_LEARN_S = 8.0  # before a change of the wind says something
_MIN_LIFT = 0.3  # of the weight: of less, nothing can be said
_MIN_AIRSPEED = 5.0  # m/s
_MODEL = 0.1  # standard deviation of the ratio by errors of mass and coefficients
_MIN_SCATTER = 0.03  # the same by what else is no gust


@compiled
def note_lift(
    kalman: np.void, airspeed: np.void, pressure: float, period_s: float, assumed: np.void
) -> None:
    """Take lift and pressure of now into the means.

    The angle of attack is the one of the mean wind: the filter's wind follows the tube.

    Args:
        kalman: Record of dtype `FILTER`.
        airspeed: Record of dtype `AIRSPEED`.
        pressure: Dynamic pressure that the tube shows [Pa].
        period_s: Time since the last call [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    x, R = kalman["x"], rotation(kalman["quaternion"])
    if airspeed["age"] == 0.0:
        airspeed["wind"][0], airspeed["wind"][1] = x[WIND], x[WIND + 1]
    a = x[VEL] - airspeed["wind"][0], x[VEL + 1] - airspeed["wind"][1], x[VEL + 2]
    ahead = max(dot(column(R, 0), a), _MIN_AIRSPEED)
    alpha = math.atan2(dot(column(R, 2), a), ahead)
    expected = 0.5 * assumed["density"] * ahead * ahead
    carried = (assumed["lift0"] + assumed["lift"] * alpha) * pressure
    values = carried, -kalman["force"][2], pressure, expected
    times = _SHORT_S, min(assumed["icing_mean_s"], airspeed["age"] + period_s)
    for k in range(FLIGHT):
        for j in range(len(values)):
            airspeed["means"][k, j] += period_s / times[k] * (values[j] - airspeed["means"][k, j])
    airspeed["slope"] = assumed["lift"] * expected / (assumed["gravity"] * ahead)


@compiled
def _ratio(airspeed: np.void, k: int) -> float:
    """Return what a tube's pressure would carry over what is carried, of a mean: 0 at the least."""
    return float(max(airspeed["means"][k, CARRIED] / airspeed["means"][k, LIFT], 0.0))


@compiled
def says_something(airspeed: np.void, k: int, assumed: np.void) -> bool:
    """Return whether there is lift enough in a mean for a ratio."""
    return bool(airspeed["means"][k, LIFT] > _MIN_LIFT * assumed["gravity"])


@compiled
def _learned_s(airspeed: np.void) -> float:
    """Return for how long it has learned, as far as it remembers [s]."""
    return float(min(max(airspeed["age"] - SETTLING_S, 0.0), _MODEL_S))


@compiled
def _excess(airspeed: np.void, assumed: np.void) -> float:
    return float(min(max(airspeed["excess"] - 1.0, 0.0), assumed["gust_excess"]))


@compiled
def _by_gusts(airspeed: np.void, assumed: np.void) -> float:
    """Return the variance of the ratio of now by vertical gusts.

    At first they are the filter's, then what was seen, a correlation time counting as a sample.
    """
    first_s, learned_s = assumed["vertical_wind_s"], _learned_s(airspeed)
    growth = assumed["gust_growth"] * _excess(airspeed, assumed)
    first = (1.0 + growth) * square(airspeed["slope"] * assumed["vertical_wind_m_s"])
    return float((first * first_s + airspeed["scatter"] * learned_s) / (first_s + learned_s))


@compiled
def lift_disagrees(airspeed: np.void, k: int, assumed: np.void) -> bool:
    """Return whether a mean is none of an aircraft that flies as fast as its tube says.

    Usual is the model's ratio of 1, for as long as gusts leave the mean of the flight less certain
    than the model is. A mean over τ of gusts with a correlation time T has T / (T + τ) of their
    variance. What the wind says is worth nothing here: a gust ahead is no fault. But in one, the
    lift explains half of what the tube shows, at the least.

    Args:
        airspeed: Record of dtype `AIRSPEED`.
        k: Number of the mean.
        assumed: Record of dtype `PARAMETERS`.
    """
    if not says_something(airspeed, k, assumed):
        return False
    by_gusts, gust_s = _by_gusts(airspeed, assumed), assumed["vertical_wind_s"]
    learned_s = _learned_s(airspeed)
    model_s = max(_BELIEVED_S, 2.0 * gust_s * by_gusts / square(_MODEL))
    share, shown = learned_s / (learned_s + model_s), _ratio(airspeed, k) - 1.0
    if says_something(airspeed, FLIGHT, assumed):
        shown -= share * (_ratio(airspeed, FLIGHT) - 1.0)
    time_s = _SHORT_S if k == SHORT else min(assumed["icing_mean_s"], airspeed["age"])
    variance = square(_MODEL) * (1.0 - share) + square(_MIN_SCATTER)
    variance += by_gusts * gust_s / (gust_s + time_s)
    explained = max(airspeed["means"][k, SHOWN], 0.0) / airspeed["means"][k, EXPECTED] - 1.0
    limit = max(math.sqrt(assumed["gate"] * variance), assumed["icing_lift"] * abs(explained))
    return bool(shown * explained > 0.0 and abs(shown) > limit)


@compiled
def _least_change(airspeed: np.void, assumed: np.void) -> float:
    """Return the least change of the wind along the x axis that says something [m/s].

    It is more in gusts, and where the wind itself is not known so well.
    """
    change = square(assumed["icing_change_m_s"]) * (
        1.0 + assumed["icing_gusts"] * _excess(airspeed, assumed)
    )
    return float(math.sqrt(change + assumed["gate"] * airspeed["unknown"]))


@compiled
def is_stalled(airspeed: np.void, assumed: np.void) -> bool:
    """Return whether no wing carries what is carried at the pressure that the tube shows."""
    means = airspeed["means"]
    slowest = 0.5 * assumed["density"] * square(STALLED * assumed["slowest"])
    least = slowest * means[SHORT, LIFT] / assumed["gravity"]
    flies = means[SHORT, EXPECTED] > slowest and says_something(airspeed, SHORT, assumed)
    return bool(flies and means[SHORT, SHOWN] < least)


@compiled
def is_impossible(airspeed: np.void, assumed: np.void) -> bool:
    """Return whether neither errors of the model nor gusts explain the ratio of the flight.

    Errors of mass and coefficients are factors, what gusts do adds up.
    """
    learned_s, gust_s = _learned_s(airspeed), assumed["vertical_wind_s"]
    if airspeed["age"] < _LEARN_S or not says_something(airspeed, FLIGHT, assumed):
        return False
    shown = _ratio(airspeed, FLIGHT) - 1.0
    by_model = math.expm1(math.copysign(math.sqrt(assumed["gate"]) * _MODEL, shown))
    share = 2.0 * gust_s / (2.0 * gust_s + learned_s)  # of the variance of a plain mean
    by_gusts = assumed["gate"] * _by_gusts(airspeed, assumed) * share
    return bool(square(shown) > square(by_model) + by_gusts)


@compiled
def is_icing(kalman: np.void, airspeed: np.void, period_s: float, assumed: np.void) -> bool:
    """Return whether wind and lift speak against the tube; both means are of before.

    A pitot tube that ices up slowly shows no single innovation: the wind takes it over.

    Args:
        kalman: Record of dtype `FILTER`.
        airspeed: Record of dtype `AIRSPEED`, after `note_lift`.
        period_s: Time since the last call [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    c, wind, P = column(rotation(kalman["quaternion"]), 0), airspeed["wind"], kalman["P"]
    airspeed["age"] += period_s
    gain = period_s / min(assumed["icing_mean_s"], airspeed["age"])
    change, variance = 0.0, 0.0
    for k in range(2):
        off = kalman["x"][WIND + k] - wind[k]
        wind[k] += gain * off
        airspeed["gusts"][k] += gain * (off * off - airspeed["gusts"][k])
        change += (kalman["x"][WIND + k] - wind[k]) * c[k]
        variance += (c[0] * P[WIND, WIND + k] + c[1] * P[WIND + 1, WIND + k]) * c[k]
    airspeed["unknown"] += gain * (variance - airspeed["unknown"])
    change, least = abs(change), _least_change(airspeed, assumed)
    if change < assumed["icing_calm_m_s"] or airspeed["age"] < _LEARN_S:
        airspeed["excess"] += gain * (kalman["gusts"] - airspeed["excess"])
    if change < least:  # else it is not the usual
        _learn(airspeed, period_s, assumed)
    lift = lift_disagrees(airspeed, SHORT, assumed) or lift_disagrees(airspeed, LONG, assumed)
    least_alone = least * assumed["icing_alone_m_s"] / assumed["icing_change_m_s"]
    agree = (change > least and lift) or change > least_alone or is_stalled(airspeed, assumed)
    airspeed["suspicious"] = airspeed["suspicious"] + period_s if agree else 0.0
    return bool(airspeed["age"] > _LEARN_S and airspeed["suspicious"] > assumed["icing_confirm_s"])


@compiled
def _learn(airspeed: np.void, period_s: float, assumed: np.void) -> None:
    """Learn the aircraft's own ratio, and the scatter of the short mean about the long one.

    Of gusts with a correlation time T, that shows τ / (T + τ) of the variance.
    """
    learned_s, means = _learned_s(airspeed), airspeed["means"]
    if learned_s == 0.0:
        airspeed["scatter"] = 0.0
        return
    gain = min(period_s / learned_s, 1.0)
    for j in range(means.shape[1]):
        means[FLIGHT, j] += gain * (means[SHORT, j] - means[FLIGHT, j])
    if says_something(airspeed, SHORT, assumed) and says_something(airspeed, LONG, assumed):
        apart = _ratio(airspeed, SHORT) - _ratio(airspeed, LONG)
        long_s = min(assumed["icing_mean_s"], airspeed["age"])
        seen = long_s / (assumed["vertical_wind_s"] + long_s)
        airspeed["scatter"] += gain * (apart * apart - seen * airspeed["scatter"])

"""The pitot tube against the lift that carries the aircraft.

L = (ρ V²/2) S (cL0 + cL_alpha α) of the nominal aircraft: what the dynamic pressure that the tube
shows would carry, over what is carried, is 1, or the aircraft's own ratio, which is learned; of a
tube that ices up, leaks or is blocked it falls with its pressure.

A vertical gust w changes α by w/V, and the lift by half of it where that is a few degrees. So the
ratio is one of two means, which a gust leaves unbiased, as it would not leave a logarithm; it is
taken over several times, as gusts average out and ice stays; and each of these means has the limit
that its own scatter gives. That is learned from how the short mean moves about the longer one,
which neither ice nor a wrong model does. Where the limit is larger than all that a tube can do,
the lift says nothing, and nobody is blamed by it.
"""

import math
from typing import Final

import numpy as np

from ftc_autopilot.estimation.measurements import column
from ftc_autopilot.estimation.state import VEL, WIND, rotation
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import dot, square

NOW: Final = 0
SHORT: Final = 1
LONG: Final = 2
FLIGHT: Final = 3
"""Means: of the last sample, of 0.4 s, of `icing_mean_s`, of what was learned."""
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
        ("means", "f8", (4, 4)),  # by the numbers above; zero: nothing is known
        ("scatter", "f8"),  # variance of the ratio by gusts, seen so far
        ("slope", "f8"),  # of the ratio by a vertical wind [s/m]
        ("suspicious", "f8"),  # for which wind and lift have spoken against the tube [s]
        ("excess", "f8"),  # mean of the filter's `gusts`, while the wind is near its mean
    ]
)
"""What the test of the pitot tube remembers."""

_NOW_S = 0.4
_MODEL_S = 60.0  # in which the model's errors are learned
_SETTLING_S = 5.0  # in which the attitude, so the angle of attack, still settles
_BELIEVED_S = 5.0  # of flight, that the model counts for at the least
_LEARN_S = 8.0  # before a change of the wind says something
_NO_GUST = 14.0  # m/s: no wind changes so far in the memory of its mean
_CALM = 0.6  # m/s
_GUSTS, _MAX_GUSTS = 6.0, 5.0  # how much larger the square of the least change is in gusts
_MIN_LIFT = 0.3  # of the weight: of less, nothing can be said
_MIN_AIRSPEED = 5.0  # m/s
_MODEL = 0.1  # standard deviation of the ratio by errors of mass and coefficients
_MIN_SCATTER = 0.03  # the same by what else is no gust
_CLEAR = 2.0  # standard deviations, beside the least change of the wind
_LEAST_CLEAR = 0.5  # of them, beside one of twice as much and more
_IMPOSSIBLE = 3.5  # standard deviations, of all that was learned
_STALLED = 0.5  # of the lowest airspeed: there, four times its lift coefficient would be needed
RESTORED = 0.5
"""Standard deviation of the wind after it has been set back to its mean [m/s]."""


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
    x, R, force = kalman["x"], rotation(kalman["quaternion"]), kalman["force"]
    if airspeed["age"] == 0.0:
        airspeed["wind"][0], airspeed["wind"][1] = x[WIND], x[WIND + 1]
    a = x[VEL] - airspeed["wind"][0], x[VEL + 1] - airspeed["wind"][1], x[VEL + 2]
    ahead, down = max(dot(column(R, 0), a), _MIN_AIRSPEED), dot(column(R, 2), a)
    alpha = math.atan2(down, ahead)
    lift = -force[2]
    expected = 0.5 * assumed["density"] * ahead * ahead
    carried = (assumed["lift0"] + assumed["lift"] * alpha) * pressure
    values = carried, lift, pressure, expected
    age, means = airspeed["age"] + period_s, airspeed["means"]
    times = period_s, _NOW_S, min(assumed["icing_mean_s"], age)
    for k in range(FLIGHT):
        for j in range(len(values)):
            means[k, j] += period_s / times[k] * (values[j] - means[k, j])
    airspeed["slope"] = assumed["lift"] * expected / (assumed["gravity"] * ahead)


@compiled
def forget_lift(airspeed: np.void) -> None:
    """Let the means say nothing until they are of samples that come after."""
    airspeed["means"][:FLIGHT, :] = 0.0


@compiled
def _ratio(airspeed: np.void, k: int) -> float:
    """Return what the tube's pressure would carry over what is carried, of a mean."""
    return float(airspeed["means"][k, CARRIED] / airspeed["means"][k, LIFT])


@compiled
def says_something(airspeed: np.void, k: int, assumed: np.void) -> bool:
    """Return whether there is lift enough in a mean for a ratio."""
    return bool(airspeed["means"][k, LIFT] > _MIN_LIFT * assumed["gravity"])


@compiled
def _learned_s(airspeed: np.void) -> float:
    """Return for how long it has learned, as far as it remembers [s]."""
    return float(min(max(airspeed["age"] - _SETTLING_S, 0.0), _MODEL_S))


@compiled
def _by_gusts(airspeed: np.void, assumed: np.void) -> float:
    """Return the variance of the ratio of now by vertical gusts.

    At first they are the filter's, then what was seen, a correlation time counting as a sample.
    """
    first_s, learned_s = assumed["vertical_wind_s"], _learned_s(airspeed)
    growth = assumed["gust_growth"] * _excess(airspeed)
    first = (1.0 + growth) * square(airspeed["slope"] * assumed["vertical_wind_m_s"])
    seen = airspeed["scatter"] * learned_s
    return float((first * first_s + seen) / (first_s + learned_s))


@compiled
def _excess(airspeed: np.void) -> float:
    return float(min(max(airspeed["excess"] - 1.0, 0.0), _MAX_GUSTS))


@compiled
def _usual(airspeed: np.void, by_gusts: float, assumed: np.void) -> tuple[float, float]:
    """Return the usual ratio and its variance: the model's 1, and the mean of the flight.

    The model counts for as long as gusts leave that mean less certain than the model is.
    """
    learned_s = _learned_s(airspeed)
    model_s = max(_BELIEVED_S, 2.0 * assumed["vertical_wind_s"] * by_gusts / square(_MODEL))
    share, usual = learned_s / (learned_s + model_s), 1.0
    if says_something(airspeed, FLIGHT, assumed):
        usual += share * (_ratio(airspeed, FLIGHT) - 1.0)
    return usual, square(_MODEL) * (1.0 - share)


@compiled
def lift_disagrees(airspeed: np.void, k: int, assumed: np.void) -> bool:
    """Return whether a mean is none of an aircraft that flies as fast as its tube says.

    A mean over τ of gusts with a correlation time T has T / (T + τ) of their variance. The further
    the wind would have changed, the less it takes; but in a gust ahead, the lift explains half of
    what the tube shows, at the least.

    Args:
        airspeed: Record of dtype `AIRSPEED`.
        k: Number of the mean.
        assumed: Record of dtype `PARAMETERS`.
    """
    if not says_something(airspeed, k, assumed):
        return False
    pressure, expected = max(airspeed["means"][k, SHOWN], 0.0), airspeed["means"][k, EXPECTED]
    explained = pressure / expected - 1.0
    change = abs(math.sqrt(pressure) - math.sqrt(expected)) / math.sqrt(0.5 * assumed["density"])
    least = _least_change(airspeed, assumed)
    clear = _CLEAR * max(least / max(change, least), _LEAST_CLEAR)
    by_gusts, gust_s = _by_gusts(airspeed, assumed), assumed["vertical_wind_s"]
    usual, variance = _usual(airspeed, by_gusts, assumed)
    time_s = (0.0, _NOW_S, min(assumed["icing_mean_s"], airspeed["age"]))[k]
    variance += square(_MIN_SCATTER) + by_gusts * gust_s / (gust_s + time_s)
    shown = max(_ratio(airspeed, k), 0.0) - usual  # of no tube it is less than 0
    limit = max(clear * math.sqrt(variance), assumed["icing_lift"] * abs(explained))
    return bool(shown * explained > 0.0 and abs(shown) > limit)


@compiled
def _least_change(airspeed: np.void, assumed: np.void) -> float:
    """Return the least change of the wind along the x axis that says something [m/s]."""
    return float(assumed["icing_change_m_s"] * math.sqrt(1.0 + _GUSTS * _excess(airspeed)))


@compiled
def is_stalled(airspeed: np.void, assumed: np.void) -> bool:
    """Return whether no wing carries what is carried at the pressure that the tube shows.

    No gust and no error of the model explains that.
    """
    means = airspeed["means"]
    slowest = 0.5 * assumed["density"] * square(_STALLED * assumed["slowest"])
    least = slowest * means[SHORT, LIFT] / assumed["gravity"]
    flies = means[SHORT, EXPECTED] > slowest and says_something(airspeed, SHORT, assumed)
    return bool(flies and means[SHORT, SHOWN] < least)


@compiled
def is_impossible(airspeed: np.void, assumed: np.void) -> bool:
    """Return whether neither errors of the model nor gusts explain the ratio of the flight."""
    learned_s, gust_s = _learned_s(airspeed), assumed["vertical_wind_s"]
    if airspeed["age"] < _LEARN_S or not says_something(airspeed, FLIGHT, assumed):
        return False
    share = 2.0 * gust_s / (2.0 * gust_s + learned_s)  # of the variance of a plain mean
    variance = square(_MODEL) + _by_gusts(airspeed, assumed) * share
    shown = max(_ratio(airspeed, FLIGHT), 0.0) - 1.0
    return bool(abs(shown) > _IMPOSSIBLE * math.sqrt(variance))


@compiled
def forget_ratio(airspeed: np.void) -> None:
    """Forget what was learned of a tube that was wrong from the start."""
    airspeed["means"][FLIGHT, :] = 0.0


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
    x, c = kalman["x"], column(rotation(kalman["quaternion"]), 0)
    airspeed["age"] += period_s
    gain = period_s / min(assumed["icing_mean_s"], airspeed["age"])
    for k in range(2):
        off = x[WIND + k] - airspeed["wind"][k]
        airspeed["wind"][k] += gain * off
        airspeed["gusts"][k] += gain * (off * off - airspeed["gusts"][k])
    change = abs(_change_along(x, airspeed, c[0], c[1]))
    if change < _CALM or airspeed["age"] < _LEARN_S:
        airspeed["excess"] += gain * (kalman["gusts"] - airspeed["excess"])
    least = _least_change(airspeed, assumed)
    if change < least:  # else it is not the usual
        _learn(airspeed, period_s, assumed)
    lift = lift_disagrees(airspeed, SHORT, assumed) or lift_disagrees(airspeed, LONG, assumed)
    agree = (change > least and lift) or change > _NO_GUST or is_stalled(airspeed, assumed)
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
        means[FLIGHT, j] += gain * (means[NOW, j] - means[FLIGHT, j])
    if says_something(airspeed, SHORT, assumed) and says_something(airspeed, LONG, assumed):
        apart = _ratio(airspeed, SHORT) - _ratio(airspeed, LONG)
        long_s = min(assumed["icing_mean_s"], airspeed["age"])
        seen = long_s / (assumed["vertical_wind_s"] + long_s)
        airspeed["scatter"] += gain * (apart * apart - seen * airspeed["scatter"])


@compiled
def _change_along(x: np.ndarray, airspeed: np.void, north: float, east: float) -> float:
    """Return the change of the wind along a direction [m/s]."""
    wind = airspeed["wind"]
    return float((x[WIND] - wind[0]) * north + (x[WIND + 1] - wind[1]) * east)


@compiled
def restore_wind(kalman: np.void, airspeed: np.void) -> None:
    """Set the wind back to its mean, with a covariance of its own."""
    x, P = kalman["x"], kalman["P"]
    for k in range(2):
        kalman["owed"][WIND + k] += airspeed["wind"][k] - x[WIND + k]
        x[WIND + k] = airspeed["wind"][k]
        for j in range(len(x)):
            P[WIND + k, j], P[j, WIND + k] = 0.0, 0.0
        P[WIND + k, WIND + k] = RESTORED * RESTORED + airspeed["gusts"][k]

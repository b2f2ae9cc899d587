"""The pitot tube against the lift that carries the aircraft.

L = (ρ V²/2) S (cL0 + cL_alpha α) of the nominal aircraft: the dynamic pressure that the tube
shows, over the one that the lift needs. In a gust both change together; of a tube that ices up,
leaks or is blocked, one does. Their ratio, the aircraft's own, is learned in flight, and how far it
scatters; so errors of mass and coefficients do not matter, and the limit comes from the scatter.
"""

import math

import numpy as np

from ftc_autopilot.estimation.measurements import column, through_air
from ftc_autopilot.estimation.state import VEL, WIND, rotation
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import dot, square

AIRSPEED = np.dtype(
    [
        ("age", "f8"),  # for which it has learned [s]
        ("wind", "f8", (2,)),  # mean wind, north and east [m/s]
        ("gusts", "f8", (2,)),  # mean square of what it differs from that [m²/s²]
        ("usual", "f8"),  # mean logarithm of the ratio of the dynamic pressures
        ("scatter", "f8"),  # its variance
        ("now", "f8"),  # the same of the last 0.4 s
        ("explained", "f8"),  # what it would be of a tube that is wrong, see `lift_ratio`
        ("suspicious", "f8"),  # for which wind and lift have spoken against the tube [s]
        ("excess", "f8"),  # mean of the filter's `gusts`, while the wind is near its mean
    ]
)
"""What the test of the pitot tube remembers."""

_NOW_S = 0.4
_MODEL_S = 60.0  # in which the model's errors are learned
_BELIEVED_S = 5.0  # of flight, that the model counts for
_LEARN_S = 8.0  # before a change of the wind says something
_NO_GUST = 14.0  # m/s: no wind changes so far in the memory of its mean
_CALM = 0.6  # m/s
_GUSTS, _MAX_GUSTS = 6.0, 5.0  # how much larger the square of the least change is in gusts
_MIN_LIFT = 0.3  # of the weight: of less, nothing can be said
_MIN_AIRSPEED = 5.0  # m/s
_MODEL = 0.1  # standard deviation of the logarithm by errors of mass and coefficients
_MIN_SCATTER = 0.03
_IMPOSSIBLE = 0.5  # of the usual logarithm
_CLEAR = 3.0  # standard deviations of the scatter
RESTORED = 0.5
"""Standard deviation of the wind after it has been set back to its mean [m/s]."""


@compiled
def lift_ratio(kalman: np.void, airspeed: np.void, pressure: float, assumed: np.void) -> float:
    """Return the logarithm of a dynamic pressure over the one that the lift needs.

    The angle of attack is the one of the mean wind: the filter's wind follows the tube.

    Args:
        kalman: Record of dtype `FILTER`.
        airspeed: Record of dtype `AIRSPEED`; `explained` is written: the ratio that a tube would
            have that is wrong by what it differs from the mean wind.
        pressure: Dynamic pressure along the x axis [Pa].
        assumed: Record of dtype `PARAMETERS`.

    Returns:
        NaN where there is too little lift to say something.
    """
    x, R = kalman["x"], rotation(kalman["quaternion"])
    a = through_air(x)
    if airspeed["age"] > 0.0:
        a = x[VEL] - airspeed["wind"][0], x[VEL + 1] - airspeed["wind"][1], x[VEL + 2]
    ahead, down = max(dot(column(R, 0), a), _MIN_AIRSPEED), dot(column(R, 2), a)
    alpha = math.atan2(down, ahead)
    force = kalman["force"]
    lift = force[0] * math.sin(alpha) - force[2] * math.cos(alpha)
    coefficient = assumed["lift0"] + assumed["lift"] * alpha  # over m / S
    if lift < _MIN_LIFT * assumed["gravity"] or coefficient <= 0.0:
        return math.nan
    dynamic = max(pressure, 0.5 * assumed["density"] * square(_MIN_AIRSPEED))
    airspeed["explained"] = math.log(dynamic / (0.5 * assumed["density"] * ahead * ahead))
    return math.log(coefficient * dynamic / lift)


@compiled
def limit_of(airspeed: np.void) -> float:
    """Return how far the ratio may be from its usual value."""
    return _CLEAR * math.sqrt(airspeed["scatter"] + square(_MIN_SCATTER))


@compiled
def is_impossible(airspeed: np.void) -> bool:
    """Return whether the usual ratio is none that errors of the model explain."""
    return bool(abs(airspeed["usual"]) > _IMPOSSIBLE and airspeed["age"] > _BELIEVED_S)


@compiled
def forget(airspeed: np.void) -> None:
    """Forget what was learned of a tube that was wrong from the start."""
    airspeed["usual"] = min(max(airspeed["usual"], -_MODEL), _MODEL)
    airspeed["now"] = airspeed["usual"]


@compiled
def lift_disagrees(airspeed: np.void, ratio: float, assumed: np.void) -> bool:
    """Return whether a ratio is none of an aircraft that flies as fast as its tube says.

    In a gust, the lift explains half of what the tube shows, at the least.
    """
    shown, explained = ratio - airspeed["usual"], airspeed["explained"]
    share = assumed["icing_lift"] * abs(explained)
    return bool(shown * explained > 0.0 and abs(shown) > max(limit_of(airspeed), share))


@compiled
def is_icing(kalman: np.void, airspeed: np.void, period_s: float, assumed: np.void) -> bool:
    """Return whether wind and lift speak against the tube; both means are of before.

    A pitot tube that ices up slowly shows no single innovation: the wind takes it over.

    Args:
        kalman: Record of dtype `FILTER`.
        airspeed: Record of dtype `AIRSPEED`.
        period_s: Time since the last call [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    x = kalman["x"]
    a = through_air(x)
    c = column(rotation(kalman["quaternion"]), 0)
    ahead = dot(c, a)
    if ahead < _MIN_AIRSPEED:
        return False
    ratio = lift_ratio(kalman, airspeed, 0.5 * assumed["density"] * ahead * ahead, assumed)
    if airspeed["age"] == 0.0:
        airspeed["wind"][0], airspeed["wind"][1] = x[WIND], x[WIND + 1]
        airspeed["now"] = airspeed["usual"]
        airspeed["scatter"] = square(_MODEL)
    if math.isnan(ratio):
        return False
    airspeed["age"] += period_s
    airspeed["now"] += period_s / _NOW_S * (ratio - airspeed["now"])
    gain = period_s / min(assumed["icing_mean_s"], airspeed["age"] + period_s)
    slowly = period_s / min(_MODEL_S, airspeed["age"] + _BELIEVED_S)
    for k in range(2):
        off = x[WIND + k] - airspeed["wind"][k]
        airspeed["wind"][k] += gain * off
        airspeed["gusts"][k] += gain * (off * off - airspeed["gusts"][k])
    change = -_change_along(x, airspeed, c[0], c[1])  # of the airspeed that the tube shows
    if abs(change) < _CALM or airspeed["age"] < _LEARN_S:
        airspeed["excess"] += gain * (kalman["gusts"] - airspeed["excess"])
    excess = min(max(airspeed["excess"] - 1.0, 0.0), _MAX_GUSTS)
    least = assumed["icing_change_m_s"] * math.sqrt(1.0 + _GUSTS * excess)
    if abs(change) < least:  # else it is not the usual
        apart = airspeed["now"] - airspeed["usual"]
        airspeed["usual"] += slowly * apart
        airspeed["scatter"] += slowly * (min(apart * apart, square(_MODEL)) - airspeed["scatter"])
    agree = abs(change) > least and lift_disagrees(airspeed, airspeed["now"], assumed)
    agree = agree or abs(change) > _NO_GUST
    airspeed["suspicious"] = airspeed["suspicious"] + period_s if agree else 0.0
    return bool(airspeed["age"] > _LEARN_S and airspeed["suspicious"] > assumed["icing_confirm_s"])


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

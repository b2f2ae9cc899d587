"""A pitot tube that ices up slowly: no single innovation shows it, for the wind takes it over.

Two signs have to agree. The estimated wind along the x axis changes against its mean of the last
15 s; and the airspeed that the pitot tube shows changes against the one that carries the aircraft,
from the lift L = (ρ V²/2) S (cL0 + cL_alpha α) of the nominal aircraft. In a gust both airspeeds
change together. The ratio of the two is learned in flight, so that errors of mass and coefficients
do not matter. A change of twice that size needs no second sign.
"""

import math

import numpy as np

from ftc_autopilot.estimation.measurements import column, through_air
from ftc_autopilot.estimation.state import WIND, rotation
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import dot, norm

ICING = np.dtype(
    [
        ("age", "f8"),  # for which it has learned [s]
        ("wind", "f8", (2,)),  # mean wind, north and east [m/s]
        ("usual", "f8"),  # mean logarithm of the ratio of the dynamic pressures
        ("now", "f8"),  # the same of the last second
        ("gusts", "f8"),  # mean of the filter's gusts, while the wind is near its mean
        ("suspicious", "f8"),  # for which both signs have agreed [s]
    ]
)
"""What the test of the pitot tube remembers."""

_NOW_S = 0.4
_LEARN_S = 8.0  # before it judges
_CLEAR = 2.0  # times the least change the lift is not asked: it moves with manoeuvres, too
_CALM = 0.6  # m/s
_GUSTS, _MAX_GUSTS = 6.0, 5.0  # how much larger the square of the least change is in gusts
_MIN_LIFT = 0.02  # of the coefficient of lift, times S / m [m²/kg]
_MIN_AIRSPEED = 5.0  # m/s
RESTORED = 0.5
"""Standard deviation of the wind after it has been set back to its mean [m/s]."""


@compiled
def is_icing(kalman: np.void, icing: np.void, period_s: float, assumed: np.void) -> bool:
    """Return whether the pitot tube ices up; the mean wind is what it was before.

    Args:
        kalman: Record of dtype `FILTER`.
        icing: Record of dtype `ICING`.
        period_s: Time since the last call [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    x = kalman["x"]
    R, a = rotation(kalman["quaternion"]), through_air(x)
    V, c = norm(a), column(R, 0)
    ahead = dot(c, a)
    if V < _MIN_AIRSPEED or ahead < _MIN_AIRSPEED:
        return False
    alpha = math.atan2(dot(column(R, 2), a), ahead)
    coefficient = assumed["lift0"] + assumed["lift"] * alpha  # over m / S
    force = kalman["force"]
    lift = force[0] * math.sin(alpha) - force[2] * math.cos(alpha)
    share = coefficient * 0.5 * assumed["density"] * V * V / assumed["gravity"]
    if share < _MIN_LIFT or lift < _MIN_LIFT * assumed["gravity"]:
        return False  # no lift to speak of: nothing is learned
    ratio = math.log(coefficient * 0.5 * assumed["density"] * V * V / lift)
    first = icing["age"] == 0.0
    icing["age"] += period_s
    if first:
        icing["usual"], icing["now"] = ratio, ratio
        icing["wind"][0], icing["wind"][1] = x[WIND], x[WIND + 1]
    icing["now"] += period_s / _NOW_S * (ratio - icing["now"])
    gain = period_s / min(assumed["icing_mean_s"], icing["age"] + period_s)
    icing["usual"] += gain * (ratio - icing["usual"])
    for k in range(2):
        icing["wind"][k] += gain * (x[WIND + k] - icing["wind"][k])
    change = -_change_along(x, icing, c[0], c[1])  # of the airspeed that the tube shows
    explained = 2.0 * change / V
    shown = icing["now"] - icing["usual"]
    if abs(change) < _CALM or icing["age"] < _LEARN_S:
        icing["gusts"] += gain * (kalman["gusts"] - icing["gusts"])
    excess = min(max(icing["gusts"] - 1.0, 0.0), _MAX_GUSTS)
    limit = assumed["icing_change_m_s"] * math.sqrt(1.0 + _GUSTS * excess)
    agree = abs(change) > limit and shown / explained > assumed["icing_lift"]
    agree = agree or abs(change) > _CLEAR * limit
    icing["suspicious"] = icing["suspicious"] + period_s if agree else 0.0
    return bool(icing["age"] > _LEARN_S and icing["suspicious"] > assumed["icing_confirm_s"])


@compiled
def _change_along(x: np.ndarray, icing: np.void, north: float, east: float) -> float:
    """Return the change of the wind along a direction [m/s]."""
    return float((x[WIND] - icing["wind"][0]) * north + (x[WIND + 1] - icing["wind"][1]) * east)


@compiled
def restore_wind(kalman: np.void, icing: np.void) -> None:
    """Set the wind back to its mean, with a covariance of its own."""
    x, P = kalman["x"], kalman["P"]
    for k in range(2):
        kalman["owed"][WIND + k] += icing["wind"][k] - x[WIND + k]
        x[WIND + k] = icing["wind"][k]
        for j in range(len(x)):
            P[WIND + k, j], P[j, WIND + k] = 0.0, 0.0
        P[WIND + k, WIND + k] = RESTORED * RESTORED

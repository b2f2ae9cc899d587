"""Pairing: whether the aileron is what rolls and the rudder what yaws, or each does both.

The relative gain (Bristol 1966) is the rolling moment by the aileron while the rudder is at rest,
by the one while the rudder balances the aileron's yawing moment:

    λ = l_δa n_δr/(l_δa n_δr - l_δr n_δa)

It is 1 without coupling. Where it is small, a surface that is moved for its own axis turns the
other one as much, and both have to be moved together: a rolling acceleration takes them in one
ratio, a yawing one in another, the columns of the inverse of J⁻¹C of roll and yaw.
"""

import math

import numpy as np

from sitl_plant.airframe.aerodynamics import Lateral, control_effectiveness, lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

MIN_RELATIVE_GAIN = 0.8
"""Below it aileron and rudder are coupled.

The tube law, which can plan them one after the other or together, needs as many messages either
way on Aerosondes whose rolling moment by rudder and yawing moment by aileron make it 0.8.
"""
_ANY_AIRSPEED = 1.0  # m/s; ratios of moments do not depend on it


def relative_gain(aircraft: Aircraft) -> float:
    """Return the relative gain of the aileron on rolling; NaN if both surfaces do the same."""
    air = _air(aircraft)
    determinant = _determinant(air)
    own = air.rolling.aileron * air.yawing.rudder
    return own / determinant if determinant != 0.0 else math.nan


def is_coupled(aircraft: Aircraft) -> bool:
    """Return whether aileron and rudder, of an aircraft that has both, do each other's work.

    They do not where a surface does nothing about its own axis, or both do the same: other checks
    are about these.
    """
    gain = relative_gain(aircraft)
    return aircraft.has("rudder") and gain != 0.0 and gain < MIN_RELATIVE_GAIN


def joint_moves(aircraft: Aircraft) -> np.ndarray:
    """Return the deflections that turn a coupled aircraft about one axis only, while it is at rest.

    Returns:
        Of aileron and rudder (columns) for rolling and yawing (rows), the largest of each row 1,
        shape (2, 2).
    """
    of_both = np.ix_((0, 2), (0, 2))
    moves = np.linalg.inv(control_effectiveness(aircraft_record(aircraft))[of_both]).T
    largest: np.ndarray = moves / moves[(0, 1), np.abs(moves).argmax(axis=1)][:, None]
    return largest


def surfaces_by_sideslip(aircraft: Aircraft) -> tuple[float, float]:
    """Return aileron and rudder by the sideslip [rad/rad] that they hold the heading at.

    Of a coupled aircraft both together balance rolling and yawing moment; else the rudder alone is
    reckoned with, and the yawing moment. NaN if it makes none.
    """
    air = _air(aircraft)
    roll, yaw = air.rolling, air.yawing
    if not is_coupled(aircraft):
        return 0.0, -yaw.beta / yaw.rudder if yaw.rudder != 0.0 else math.nan
    determinant = _determinant(air)
    return (
        (roll.rudder * yaw.beta - yaw.rudder * roll.beta) / determinant,
        (yaw.aileron * roll.beta - roll.aileron * yaw.beta) / determinant,
    )


def _air(aircraft: Aircraft) -> Lateral:
    found: Lateral = lateral(_ANY_AIRSPEED, aircraft_record(aircraft))
    return found


def _determinant(air: Lateral) -> float:
    roll, yaw = air.rolling, air.yawing
    return float(roll.aileron * yaw.rudder - roll.rudder * yaw.aileron)

"""A coarse first estimate of an aircraft in flight, from one sample of its sensors.

Gravity in body axes is the acceleration less the specific force. The acceleration of an aircraft
that does not speed up is ω × v, with the airspeed for v (M. Euston et al., A complementary filter
for attitude estimation of a fixed-wing UAV, IROS 2008). It gives roll and pitch, the magnetic field
then the heading. Level flight gives the angle of attack: the pitch angle. The further its length is
from g, the less it says: the aircraft speeds up or falls, and counts as level.
"""

import math

import numpy as np

from ftc_autopilot.estimation.state import (
    BARO_ERROR,
    DELAY,
    FORCE_BIAS,
    GNSS_ERROR,
    GYRO_BIAS,
    MAG_BIAS,
    PHI,
    PITOT_SCALE,
    POS,
    VEL,
    WIND,
    N,
    rotation,
    set_euler,
)
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, cross, hypot, mul, norm, square, sub, vec3

_FAR_FROM_GRAVITY = 0.25  # of it
_UNKNOWN_TILT = math.radians(15.0)
_UNKNOWN_HEADING = math.radians(60.0)
_TILT_IN_TURN = 0.2  # of the roll angle that is not known
_AIR = 4.0  # m/s, velocity through the air
_UNKNOWN_AIR = 0.5  # of the cruising speed
STALLED = 0.5
"""Of the lowest airspeed: less shows no tube of an aircraft that flies, whose wing would need four
times its lift coefficient there."""


@compiled
def align(
    kalman: np.void,
    rates: Vec3,
    force: Vec3,
    field: Vec3,
    pressure: float,
    altitude: float,
    assumed: np.void,
) -> None:
    """Begin a filter.

    Args:
        kalman: Record of dtype `FILTER`, whose `resets` stay.
        rates: Sample of the gyro [rad/s].
        force: Sample of the accelerometer [m/s²].
        field: Sample of the magnetometer [gauss]; zero: none.
        pressure: Differential pressure [Pa]; NaN: none.
        altitude: Pressure altitude [m, above sea level]; NaN: none.
        assumed: Record of dtype `PARAMETERS`.
    """
    x = kalman["x"]
    u, air = math.sqrt(max(2.0 * pressure / assumed["density"], 0.0)), _AIR
    if not u > STALLED * assumed["slowest"]:  # no pitot tube, or a blocked one
        u, air = assumed["cruise"], _UNKNOWN_AIR * assumed["cruise"]
    gravity = sub(cross(rates, (u, 0.0, 0.0)), force)
    trust = max(1.0 - abs(norm(gravity) / assumed["gravity"] - 1.0) / _FAR_FROM_GRAVITY, 0.0)
    roll = trust * math.atan2(gravity[1], gravity[2])
    pitch = trust * math.atan2(-gravity[0], hypot(gravity[1], gravity[2]))
    set_euler(kalman["quaternion"], roll, pitch, 0.0)
    level = mul(rotation(kalman["quaternion"]), field)  # yaw is what turns it into the field
    north, east = assumed["field"][0], assumed["field"][1]
    has_heading = field[0] != 0.0 or field[1] != 0.0 or field[2] != 0.0
    yaw = math.atan2(east, north) - math.atan2(level[1], level[0]) if has_heading else 0.0
    set_euler(kalman["quaternion"], roll, pitch, yaw)
    _begin_at_zero(kalman, rates, force)
    speed = u / max(math.cos(pitch), 0.5)
    x[VEL], x[VEL + 1] = speed * math.cos(yaw), speed * math.sin(yaw)
    has_altitude = math.isfinite(altitude)
    x[POS + 2] = assumed["altitude"] - altitude if has_altitude else 0.0
    tilt = trust * (assumed["tilt_rad"] + _TILT_IN_TURN * abs(roll)) + (1.0 - trust) * _UNKNOWN_TILT
    dip = abs(assumed["field"][2]) / max(hypot(north, east), 1e-3)
    heading = min(hypot(assumed["heading_rad"], dip * tilt), _UNKNOWN_HEADING)
    heading = heading if has_heading else _UNKNOWN_HEADING
    _spread(kalman["P"], tilt, heading, air, vec3(x[VEL:]), assumed)
    if not has_altitude:
        kalman["P"][POS + 2, POS + 2] = assumed["place_m"] * assumed["place_m"]
    kalman["aligned"], kalman["placed"], kalman["odd"] = 1, 0, 0


@compiled
def _begin_at_zero(kalman: np.void, rates: Vec3, force: Vec3) -> None:
    """Set what a filter estimates and sums up to zero, its last samples to the present ones."""
    kalman["x"][:] = 0.0
    kalman["owed"][:] = 0.0
    kalman["travel"][:] = 0.0
    kalman["sum_force"][:] = 0.0
    kalman["sum_R"][:] = 0.0
    kalman["elapsed"], kalman["turned"] = 0.0, 0.0
    for k in range(3):
        kalman["rates"][k], kalman["force"][k] = rates[k], force[k]


@compiled
def _spread(
    P: np.ndarray, tilt: float, heading: float, error: float, air: Vec3, assumed: np.void
) -> None:
    """Write the covariance of a coarse estimate: velocity is through the air, and the wind's.

    Args:
        P: Written.
        tilt: Standard deviation of roll and pitch [rad].
        heading: The same of the heading [rad].
        error: The same of the velocity through the air [m/s].
        air: Velocity through the air, NED [m/s].
        assumed: Record of dtype `PARAMETERS`.
    """
    for r in range(N):
        for c in range(N):
            P[r, c] = 0.0
    for i in range(3):
        P[PHI + i, PHI + i] = tilt * tilt
        P[VEL + i, VEL + i] = error * error
        P[POS + i, POS + i] = assumed["place_m"] * assumed["place_m"]
        P[GYRO_BIAS + i, GYRO_BIAS + i] = assumed["gyro_bias"]
        P[FORCE_BIAS + i, FORCE_BIAS + i] = assumed["force_bias"]
        P[MAG_BIAS + i, MAG_BIAS + i] = assumed["magnetometer_bias"]
        P[GNSS_ERROR + i, GNSS_ERROR + i] = assumed["gnss_error"][i]
        wind = square(assumed["wind_m_s"] if i < 2 else assumed["vertical_wind_m_s"])
        P[WIND + i, WIND + i] = wind
        P[VEL + i, VEL + i] += wind
        P[VEL + i, WIND + i] = wind
        P[WIND + i, VEL + i] = wind
    P[PHI + 2, PHI + 2] = heading * heading
    _turn_with_attitude(P, air)
    P[POS + 2, POS + 2] = assumed["barometer_bias"] + assumed["barometer"]
    P[BARO_ERROR, BARO_ERROR] = assumed["barometer_bias"]
    P[POS + 2, BARO_ERROR] = assumed[
        "barometer_bias"
    ]  # D is altitude of the origin + error - reading
    P[BARO_ERROR, POS + 2] = assumed["barometer_bias"]
    P[PITOT_SCALE, PITOT_SCALE] = assumed["pitot_scale"]
    P[DELAY, DELAY] = square(assumed["latency_error_s"])


@compiled
def _turn_with_attitude(P: np.ndarray, air: Vec3) -> None:
    """Let the velocity through the air, known in body axes, turn with the attitude: phi × a.

    Without it a pitot tube would seem to show the heading.
    """
    variances = P[PHI, PHI], P[PHI + 1, PHI + 1], P[PHI + 2, PHI + 2]
    J = ((0.0, air[2], -air[1]), (-air[2], 0.0, air[0]), (air[1], -air[0], 0.0))
    for i in range(3):
        for j in range(3):
            P[VEL + i, PHI + j] = J[i][j] * variances[j]
            P[PHI + j, VEL + i] = J[i][j] * variances[j]
            for k in range(3):
                P[VEL + i, VEL + j] += J[i][k] * variances[k] * J[j][k]

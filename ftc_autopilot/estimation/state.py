"""The filter's state: what it estimates, its covariance, and what it has to remember.

The error is x_true - x, but for the attitude: a rotation vector phi in NED axes, with
R_true = (I + [phi]x) R, the global error of J. Solà, Quaternion kinematics for the error-state
Kalman filter, 2017, section 7.
"""

import math

import numpy as np

from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.vec3 import Mat3, Vec3, dot

N = 27
"""Elements of the error."""

PHI, VEL, POS, GYRO_BIAS, FORCE_BIAS, WIND, MAG_BIAS, GNSS_ERROR = range(0, 24, 3)
"""Where in the error: attitude, velocity, position [NED], biases of gyro and accelerometer [body],
wind [NED], bias of the magnetometer [body], correlated error of the GNSS position [NED]."""
BARO_ERROR, PITOT_SCALE, DELAY = 24, 25, 26
"""Of the barometer's altitude, of the pitot tube's scale, of the age of a fix [s]."""

AIDING = MAGNETOMETER, BAROMETER, PITOT, GNSS
"""The sensors beside the IMUs."""
GNSS_VELOCITY, GNSS_HEIGHT = max(AIDING) + 1, max(AIDING) + 2
"""What a GNSS receiver reports beside its horizontal position, `GNSS`; each is judged by itself."""
GNSS_PARTS = GNSS, GNSS_VELOCITY, GNSS_HEIGHT
TESTED = *AIDING, GNSS_VELOCITY, GNSS_HEIGHT
N_SENSORS = max(TESTED) + 1
"""Length of what each sensor has a place in, by its number."""
SIDESLIP = N_SENSORS
"""Number of the sideslip, an assumption: it cannot fail, and its innovations come last."""

FILTER = np.dtype(
    [
        ("quaternion", "f8", (4,)),  # body to NED, scalar first
        ("x", "f8", (N,)),  # the estimate, in the order of the error; the attitude's place is 0
        ("P", "f8", (N, N)),
        ("h", "f8", (N,)),  # row of the measurement matrix that is fused
        ("Ph", "f8", (N,)),
        # since the covariance was last propagated
        ("elapsed", "f8"),  # s
        ("turned", "f8"),  # rad
        ("sum_R", "f8", (3, 3)),  # integral of R [s]
        ("sum_force", "f8", (3,)),  # integral of R f [m/s], NED
        # integrals without corrections, for samples of the past
        ("travel", "f8", (7,)),  # of acceleration [m/s], of that [m], time [s]
        # corrections that the output has not shown yet: attitude, velocity, position, wind
        ("owed", "f8", (N,)),
        ("rates", "f8", (3,)),  # unbiased and filtered, body [rad/s]
        ("force", "f8", (3,)),  # the same of the specific force [m/s²]
        ("ratios", "f8", (SIDESLIP + 1,)),  # squared innovation over its variance, the last of each
        ("normal", "f8"),  # the last normalised innovation
        ("gusts", "f8"),  # mean squared normalised innovation of the pitot tube, over 3 s
        ("trends", "f8", (6,)),  # means of normalised innovations: field, velocity
        ("entry", "i8"),  # of the memory, that comes next
        ("blind", "i8", (2,)),  # 1: gyro, accelerometer say nothing
        ("unsettled", "f8"),  # time for which it may still be settling [s]
        ("resets", "i8"),
        ("aligned", "i8"),
        ("placed", "i8"),  # 1: a GNSS sample was fused
        ("odd", "i8"),  # 1: its first wind was none that is to be expected
    ]
)
"""One filter, which runs by one IMU."""

TRAVEL = 7
"""Elements of `travel`."""

HISTORY_S = 0.01
"""Time between two propagations of the covariance, and between two entries of the memory [s]."""


@inlined
def rotation(q: np.ndarray) -> Mat3:
    """Return the rotation matrix of a quaternion, body to NED; Solà, section 2.5."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled
def turn_body(q: np.ndarray, angle: Vec3) -> None:
    """Turn by a rotation vector in body axes: q ⊗ Exp(angle), Solà, section 4.6."""
    _multiply(q, angle, 1.0)


@compiled
def turn_world(q: np.ndarray, angle: Vec3) -> None:
    """Turn by a rotation vector in NED axes: Exp(angle) ⊗ q, Solà, section 7."""
    _multiply(q, angle, -1.0)


@inlined
def _multiply(q: np.ndarray, angle: Vec3, side: float) -> None:
    """Multiply with a rotation from the right (side 1) or from the left (-1)."""
    size = math.sqrt(angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2])
    c = math.cos(0.5 * size)
    s = math.sin(0.5 * size) / size if size > 1e-9 else 0.5
    x, y, z = s * angle[0], s * angle[1], s * angle[2]
    w0, x0, y0, z0 = q[0], q[1], q[2], q[3]
    w = w0 * c - x0 * x - y0 * y - z0 * z
    i = w0 * x + c * x0 + side * (y0 * z - z0 * y)
    j = w0 * y + c * y0 + side * (z0 * x - x0 * z)
    k = w0 * z + c * z0 + side * (x0 * y - y0 * x)
    scale = 1.0 / math.sqrt(w * w + i * i + j * j + k * k)
    q[0], q[1], q[2], q[3] = w * scale, i * scale, j * scale, k * scale


@compiled
def set_euler(q: np.ndarray, roll: float, pitch: float, yaw: float) -> None:
    """Set a quaternion to Euler angles 3-2-1 [rad]."""
    q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
    turn_body(q, (0.0, 0.0, yaw))
    turn_body(q, (0.0, pitch, 0.0))
    turn_body(q, (roll, 0.0, 0.0))


@inlined
def euler(R: Mat3) -> Vec3:
    """Return roll, pitch, yaw [rad] of a rotation from body to NED."""
    pitch = -math.asin(min(max(R[2][0], -1.0), 1.0))
    return math.atan2(R[2][1], R[2][2]), pitch, math.atan2(R[1][0], R[0][0])


@compiled
def of_second_order(P: np.ndarray, c: Vec3, B: Vec3) -> float:
    """Return the variance of what the attitude's error adds to c · B in second order.

    c is an axis and B a vector, of which one turns with that error. It is φᵀ H φ / 2,
    H = (c Bᵀ + B cᵀ) / 2 - (c · B) I, and its variance tr(H P H P) / 2
    (Y. Bar-Shalom et al., Estimation with Applications to Tracking and Navigation, 2001, section
    10.3). Without it, a quiet sensor would seem to show the attitude of a coarse guess.
    """
    along, total = dot(c, B), 0.0
    for i in range(3):
        for j in range(3):
            one = other = 0.0
            for k in range(3):
                one += _bend(c, B, along, i, k) * P[PHI + k, PHI + j]
                other += _bend(c, B, along, j, k) * P[PHI + k, PHI + i]
            total += one * other
    return 0.5 * total


@inlined
def _bend(c: Vec3, B: Vec3, along: float, i: int, k: int) -> float:
    """Return an element of H, see `of_second_order`."""
    return 0.5 * (c[i] * B[k] + B[i] * c[k]) - (along if i == k else 0.0)

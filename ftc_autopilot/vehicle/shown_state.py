"""The last state, received or estimated, as messages show it, and how well it is known."""

import math
import operator
from collections.abc import Sequence

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.geography import Origin, Place, place_of
from ftc_autopilot.estimation.state import PHI, POS, VEL
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.flight_path import VehicleHome
from sitl_plant.airframe.quaternion import quaternion
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import Vec3, mul

_VECTORS = ("position", "velocity", "attitude", "rates", "specific_force", "wind")
_UNKNOWN_U16 = 2**16 - 1


class ShownState:
    """A view of the last state.

    Attributes:
        report: The estimator's, of dtype `ftc_autopilot.estimation.output.REPORT`; None in a flight
            by the true state.
    """

    def __init__(self, hot: HotState, origin: Origin, home: VehicleHome) -> None:
        self.origin, self._home = origin, home
        # views, which always show the last state
        self._vectors: dict[str, np.ndarray] = {name: hot.measured[name] for name in _VECTORS}
        estimator = hot.navigation["estimator"]
        self.report: np.void | None = estimator["report"] if hot.navigation["count"] else None
        self._filters = estimator["filters"]

    @property
    def is_placed(self) -> bool:
        """Whether it is known where the vehicle is: not before an estimate's first fix."""
        return self.report is None or bool(self.report["placed"])

    def vector(self, name: str) -> Vec3:
        """Return a vector of the last state."""
        x, y, z = self._vectors[name].tolist()
        return x, y, z

    def in_ned(self, name: str) -> Vec3:
        """Return a vector of the body's axes in the local frame's."""
        return mul(R1(self.vector("attitude")), self.vector(name))

    @property
    def velocity_ned(self) -> Vec3:
        """Velocity over ground [m/s]."""
        return self.in_ned("velocity")

    @property
    def airspeed(self) -> float:
        """Airspeed [m/s]."""
        u, v, w = map(operator.sub, self.vector("velocity"), self.vector("wind"))
        return math.sqrt(u * u + v * v + w * w)

    @property
    def height(self) -> float:
        """Height above the origin [m]."""
        return -self.vector("position")[2]

    @property
    def yaw(self) -> float:
        """Yaw [rad]."""
        return self.vector("attitude")[2]

    @property
    def place(self) -> Place:
        """Where the vehicle is; the height is that above home."""
        place = place_of(self.origin, *self.vector("position"))
        return place._replace(height=place.height - round(1e3 * self._home.at.height_m))

    # of an estimate: covariances

    def attitude_covariance(self) -> np.ndarray:
        """Return the covariance of roll, pitch and yaw [rad²], shape (3, 3)."""
        J = self._euler_rates()
        covariance: np.ndarray = J @ self._covariance(PHI) @ J.T
        return covariance

    def pose_covariance(self) -> np.ndarray:
        """Return the covariance of the position, NED, and of roll, pitch and yaw, shape (6, 6)."""
        J = np.eye(6)
        J[3:, 3:] = self._euler_rates()
        covariance: np.ndarray = J @ self._covariance(POS, PHI) @ J.T
        return covariance

    def velocity_covariance(self) -> np.ndarray:
        """Return the covariance of the velocity in body axes [m²/s²], shape (3, 3).

        Of an error of the attitude, phi, the body sees v - phi × v.
        """
        x, y, z = self.velocity_ned
        J = np.hstack([np.eye(3), [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]])
        J = np.array(R1(self.vector("attitude"))).T @ J
        covariance: np.ndarray = J @ self._covariance(VEL, PHI) @ J.T
        return covariance

    def _covariance(self, *parts: int) -> np.ndarray:
        """Return the covariance of some parts of the error, three elements each."""
        assert self.report is not None
        rows = [part + k for part in parts for k in range(3)]
        covariance: np.ndarray = self._filters[int(self.report["imu"])]["P"][np.ix_(rows, rows)]
        return covariance

    def _euler_rates(self) -> np.ndarray:
        """Return how roll, pitch and yaw change with a small turn in NED axes, shape (3, 3).

        By the rates of the Euler angles in a turn: J. Solà, Quaternion kinematics for the
        error-state Kalman filter, 2017, section 4. NaN if the attitude is not finite.
        """
        _, pitch, yaw = self.vector("attitude")
        if not math.isfinite(pitch + yaw):
            return np.full((3, 3), math.nan)
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array(
            [
                [c / math.cos(pitch), s / math.cos(pitch), 0.0],
                [-s, c, 0.0],
                [c * math.tan(pitch), s * math.tan(pitch), 1.0],
            ]
        )


def centidegrees(angle: float) -> int:
    """Return an angle [rad] as 0 to 35999 cdeg; unknown if it is NaN or inf."""
    if not math.isfinite(angle):
        return _UNKNOWN_U16
    return round(math.degrees(wrap(angle)) * 100.0) % 36000


def quaternion_of(roll: float, pitch: float, yaw: float) -> Sequence[float]:
    """Return body to NED, scalar first, from angles [rad]; NaN if one is not finite."""
    if not math.isfinite(roll + pitch + yaw):
        return (math.nan,) * 4
    return quaternion((roll, pitch, yaw))

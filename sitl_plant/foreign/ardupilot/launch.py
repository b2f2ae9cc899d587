"""The aircraft on a launcher, and its launch: until the flight begins the physics waits.

ArduPilot takes half a minute to start, and its outputs are idle until it is armed: an aircraft in
the air would be lost by then. So it is held where its launch will begin. The launch takes it along
a straight line, in its initial attitude and at a constant acceleration, to its initial state.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import in_python
from sitl_plant import vec3 as vectors
from sitl_plant.airframe import rigid_body
from sitl_plant.foreign.ardupilot.protocol import Measured
from sitl_plant.vec3 import Vec3

_R1 = in_python(rigid_body.R1)
_norm, _scale, _sub = in_python(vectors.norm), in_python(vectors.scale), in_python(vectors.sub)


class AircraftLaunch(NamedTuple):
    """One aircraft's launch; vectors are north, east, down."""

    duration_s: float
    position: Vec3  # where it ends [m]
    velocity: Vec3  # over the ground, at its end [m/s]
    attitude: Vec3  # all the time [rad]
    wind: Vec3  # velocity of the air [m/s]
    gravity: float  # [m/s²]

    def at(self, t: float, time_s: float) -> Measured:
        """Return what it measures; ideal sensors.

        Args:
            t: Time since the launch began [s]; negative: it is held.
            time_s: Time of the physics [s].
        """
        moving = t >= 0.0
        share = max(t, 0.0) / self.duration_s if self.duration_s > 0.0 else 0.0
        velocity = _scale(share, self.velocity)
        to_go = 0.5 * self.duration_s * (1.0 - share * share)
        acceleration = _scale(1.0 / self.duration_s, self.velocity) if moving else (0.0, 0.0, 0.0)
        return Measured(
            time_s=time_s,
            rates=(0.0, 0.0, 0.0),
            specific_force=into_body(_sub(acceleration, (0.0, 0.0, self.gravity)), self.attitude),
            position=_sub(self.position, _scale(to_go, self.velocity)),
            attitude=self.attitude,
            velocity=velocity,
            airspeed=_norm(_sub(velocity, self.wind)),
            wind=self.wind,
        )


def new_launch(x: np.ndarray, air: np.ndarray, gravity: float, duration_s: float) -> AircraftLaunch:
    """Return the launch into an initial state.

    Args:
        x: The state, shape (12,), see `sitl_plant.airframe.rigid_body.State`.
        air: Velocity of the air there, body axes, shape (3,) [m/s].
        gravity: Acceleration of gravity [m/s²].
        duration_s: How long it takes [s].
    """
    attitude = _floats(x[6:9])
    velocity, wind = out_of_body(_floats(x[3:6]), attitude), out_of_body(_floats(air), attitude)
    return AircraftLaunch(duration_s, _floats(x[0:3]), velocity, attitude, wind, gravity)


def out_of_body(v: Vec3, attitude: Vec3) -> Vec3:
    """Return a vector in body axes as north, east, down; roll, pitch, yaw in rad."""
    north, east, down = (float(x) for x in np.array(_R1(attitude)) @ v)
    return north, east, down


def into_body(v: Vec3, attitude: Vec3) -> Vec3:
    """Return a vector given as north, east, down in body axes; roll, pitch, yaw in rad."""
    x, y, z = (float(x) for x in np.array(_R1(attitude)).T @ v)
    return x, y, z


def _floats(values: np.ndarray) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z

"""Wind: the motion of the air around each aircraft of a plant."""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.config import Dryden, Wind
from sitl_plant.air.turbulence import dryden, new_turbulence
from sitl_plant.airframe.rigid_body import R1, STILL_AIR, Air
from sitl_plant.vec3 import Vec3, add, mul_t, vec3

WIND = np.dtype(
    [
        ("still", "i8"),  # 1: there is no wind of any kind
        ("steady", "f8", (3,)),  # NED [m/s]
        ("shear", "f8", (2,)),  # to north and east per metre of altitude [1/s]
        ("shear_altitude", "f8"),  # at which it adds nothing [m]
        ("gust_start", "f8"),  # s
        ("gust_duration", "f8"),  # s
        ("gust", "f8", (3,)),  # peak, NED [m/s]
    ]
)
"""Wind that is the same for all aircraft."""


def new_wind(config: Wind) -> np.ndarray:
    """Return what is the same for all aircraft as a record of dtype `WIND`, shape (1,)."""
    wind = np.zeros(1, WIND)
    steady, shear, gust = config.steady, config.shear, config.gust
    wind["still"] = config == Wind()
    wind["steady"] = steady.north_m_s, steady.east_m_s, steady.down_m_s
    wind["shear"] = shear.north_1_s, shear.east_1_s
    wind["shear_altitude"] = shear.altitude_m
    wind["gust_duration"] = 1.0
    if gust is not None:
        wind["gust_start"], wind["gust_duration"] = gust.start_s, gust.duration_s
        wind["gust"] = gust.north_m_s, gust.east_m_s, gust.down_m_s
    return wind


def turbulence_around(config: Wind, altitude_m: float, wing_span_m: float) -> np.void:
    """Return an aircraft's turbulence before its start, dtype `TURBULENCE`."""
    named = config.turbulence
    model = named if isinstance(named, Dryden) else dryden(named, altitude_m)
    return new_turbulence(model, wing_span_m)


@compiled
def wind_at(wind: np.void, position: Vec3, t: float) -> Vec3:
    """Return steady wind, shear and gust at a position NED [m] and a time [s]; NED [m/s]."""
    steady, shear, gust = wind["steady"], wind["shear"], wind["gust"]
    above = -position[2] - wind["shear_altitude"]
    x = (t - wind["gust_start"]) / wind["gust_duration"]
    share = 0.5 * (1.0 - math.cos(2.0 * math.pi * x)) if 0.0 < x < 1.0 else 0.0
    return (
        steady[0] + shear[0] * above + gust[0] * share,
        steady[1] + shear[1] * above + gust[1] * share,
        steady[2] + gust[2] * share,
    )


@compiled
def air_around(wind: np.void, turbulence: np.void, position: Vec3, phi: Vec3, t: float) -> Air:
    """Return the velocity and the angular velocity of the air around an aircraft, body axes.

    Args:
        wind: Record of dtype `WIND`.
        turbulence: The aircraft's, dtype `sitl_plant.air.turbulence.TURBULENCE`.
        position: NED [m].
        phi: Roll, pitch, yaw [rad].
        t: Simulation time [s].
    """
    if wind["still"] == 1:
        return STILL_AIR
    moving = mul_t(R1(phi), wind_at(wind, position, t))
    return add(moving, vec3(turbulence["velocity"])), vec3(turbulence["rates"])

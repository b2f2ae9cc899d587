"""The Earth's magnetic field at a place, by the World Magnetic Model.

A. Chulliat et al., The US/UK World Magnetic Model for 2025-2030, technical report, NOAA, 2025: the
equations of section 1.2, without the change with time. A simulation has no date: the field is that
of the model's epoch.
"""

import math

import numpy as np

from mavlink_defs.origin import Origin
from sitl_plant.sensing.wmm2025 import GAUSS_COEFFICIENTS, REFERENCE_RADIUS_KM

_DEGREE = GAUSS_COEFFICIENTS[-1][0]
_SEMI_MAJOR_AXIS_KM = 6378.137  # WGS 84
_FLATTENING = 1.0 / 298.257223563  # WGS 84
_NT_IN_GAUSS = 1e5


def magnetic_field(origin: Origin) -> np.ndarray:
    """Return the magnetic field at a place: north, east, down [gauss], shape (3,)."""
    latitude, longitude = math.radians(origin.latitude_deg), math.radians(origin.longitude_deg)
    radius_km, geocentric = _geocentric(latitude, origin.altitude_m / 1e3)
    P = _legendre(math.sin(geocentric), math.cos(geocentric))
    north = east = down = 0.0
    for n, m, g, h in GAUSS_COEFFICIENTS:
        cos_m, sin_m = math.cos(m * longitude), math.sin(m * longitude)
        amplitude = (REFERENCE_RADIUS_KM / radius_km) ** (n + 2)
        slope = (n + 1) * math.tan(geocentric) * P[n, m]
        slope -= math.sqrt((n + 1) ** 2 - m * m) / math.cos(geocentric) * P[n + 1, m]
        north -= amplitude * (g * cos_m + h * sin_m) * slope
        east += amplitude * m * (g * sin_m - h * cos_m) * P[n, m] / math.cos(geocentric)
        down -= amplitude * (n + 1) * (g * cos_m + h * sin_m) * P[n, m]
    turn = geocentric - latitude  # from the sphere's vertical to the ellipsoid's
    north, down = (
        north * math.cos(turn) - down * math.sin(turn),
        north * math.sin(turn) + down * math.cos(turn),
    )
    return np.array([north, east, down]) / _NT_IN_GAUSS


def _geocentric(latitude: float, height_km: float) -> tuple[float, float]:
    """Return radius [km] and geocentric latitude [rad] of a geodetic latitude [rad] and height."""
    squared = _FLATTENING * (2.0 - _FLATTENING)  # eccentricity²
    normal_km = _SEMI_MAJOR_AXIS_KM / math.sqrt(1.0 - squared * math.sin(latitude) ** 2)
    across = (normal_km + height_km) * math.cos(latitude)
    along = (normal_km * (1.0 - squared) + height_km) * math.sin(latitude)
    return math.hypot(across, along), math.atan2(along, across)


def _legendre(sine: float, cosine: float) -> np.ndarray:
    """Return the Schmidt semi-normalised Legendre functions, [n, m], to one degree more.

    Args:
        sine: Sine of the geocentric latitude.
        cosine: Its cosine.
    """
    P = np.zeros((_DEGREE + 2, _DEGREE + 2))
    P[0, 0] = 1.0
    for n in range(1, _DEGREE + 2):
        P[n, n] = (math.sqrt((2 * n - 1) / (2 * n)) if n > 1 else 1.0) * cosine * P[n - 1, n - 1]
        for m in range(n):
            before = math.sqrt((n - 1) ** 2 - m * m) * P[n - 2, m] if n > m + 1 else 0.0
            P[n, m] = ((2 * n - 1) * sine * P[n - 1, m] - before) / math.sqrt(n * n - m * m)
    return P

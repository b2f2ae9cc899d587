"""The International Standard Atmosphere to 20 km: what a barometer measures at an altitude.

ISO 2533:1975, and ICAO Doc 7488, Manual of the ICAO Standard Atmosphere. Altitudes are above mean
sea level and count as geopotential ones, as altimeters have it: 0.2 m apart at 1 km.
"""

import math

from mavlink_defs.runtime.jit import compiled

_GRAVITY = 9.80665  # m/s²
_GAS_CONSTANT = 287.05287  # J/(kg K), of dry air
_LAPSE = 0.0065  # K/m, in the troposphere
_SEA_LEVEL_K = 288.15
_SEA_LEVEL_HPA = 1013.25
_TROPOPAUSE_M = 11_000.0
_TROPOPAUSE_K = _SEA_LEVEL_K - _LAPSE * _TROPOPAUSE_M
_EXPONENT = _GRAVITY / (_GAS_CONSTANT * _LAPSE)
_TROPOPAUSE_HPA: float = _SEA_LEVEL_HPA * (_TROPOPAUSE_K / _SEA_LEVEL_K) ** _EXPONENT
_SCALE_M = _GAS_CONSTANT * _TROPOPAUSE_K / _GRAVITY  # of the pressure above the tropopause
_KELVIN = 273.15


@compiled
def temperature_at(altitude: float) -> float:
    """Return the temperature [°C] at an altitude [m]."""
    return max(_SEA_LEVEL_K - _LAPSE * altitude, _TROPOPAUSE_K) - _KELVIN


@compiled
def pressure_at(altitude: float) -> float:
    """Return the static pressure [hPa] at an altitude [m]."""
    if altitude > _TROPOPAUSE_M:
        return _TROPOPAUSE_HPA * math.exp((_TROPOPAUSE_M - altitude) / _SCALE_M)
    return float(_SEA_LEVEL_HPA * (1.0 - _LAPSE / _SEA_LEVEL_K * altitude) ** _EXPONENT)


@compiled
def altitude_of(pressure: float) -> float:
    """Return the altitude [m] at which the static pressure [hPa] is this, above 0."""
    if pressure < _TROPOPAUSE_HPA:
        return _TROPOPAUSE_M - _SCALE_M * math.log(pressure / _TROPOPAUSE_HPA)
    return float(_SEA_LEVEL_K / _LAPSE * (1.0 - (pressure / _SEA_LEVEL_HPA) ** (1.0 / _EXPONENT)))

"""Continuous turbulence: the Dryden model of MIL-F-8785C, section 3.7, for one aircraft.

With λ = V/L, the filters that shape white noise are

    u: σ_u sqrt(2 L_u/πV) / (1 + s/λ_u)
    v: σ_v sqrt(L_v/πV) (1 + √3 s/λ_v) / (1 + s/λ_v)², and w in the same way
    p: σ_w sqrt(0.8/V) (π/4b)^(1/6) / (L_w^(1/3) (1 + 4b s/πV))
    q: -s/V / (1 + 4b s/πV) of w,    r: s/V / (1 + 3b s/πV) of v

for the one-sided spectra of that standard, with the signs of a body that the air turns. Their white
noise is discretised exactly over a control period at its airspeed; the filters of q and r have w
and v as linear over a period. Their output holds until the next period. Each aircraft has
turbulence of its own.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.air.config import Dryden
from sitl_plant.air.gaussian import normal
from sitl_plant.airframe.aerodynamics import STILL_M_S

_CHANNEL = 200  # of the random numbers: this one and the next five
_ROOT_3 = math.sqrt(3.0)
_FOOT_M, _KNOT_M_S = 0.3048, 1852.0 / 3600.0
_WIND_AT_20_FT_KT = {"none": 0.0, "light": 15.0, "moderate": 30.0, "severe": 45.0}

TURBULENCE = np.dtype(
    [
        ("sigma", "f8", (3,)),  # of u, v, w [m/s]
        ("length", "f8", (3,)),  # m
        ("span", "f8"),  # m
        ("first", "f8", (3,)),  # output of each axis's first lag of white noise, variance 1/2
        ("second", "f8", (3,)),  # output of a second lag behind it (not of u)
        ("roll", "f8"),  # state of p, variance 1
        ("smooth", "f8", (2,)),  # v and w behind the lags of r and q [m/s]
        ("velocity", "f8", (3,)),  # of the air, body axes [m/s]
        ("rates", "f8", (3,)),  # of the air, body axes [rad/s]
    ]
)


def dryden(intensity: str, altitude_m: float) -> Dryden:
    """Return the low-altitude model of MIL-F-8785C, section 3.7.3.4.

    It is meant for 10 to 1000 ft; altitudes outside are taken as the nearest of these.

    Args:
        intensity: "none", "light", "moderate" or "severe": 0, 15, 30 or 45 knots at 20 ft.
        altitude_m: Above ground [m].
    """
    h = min(max(altitude_m / _FOOT_M, 10.0), 1000.0)
    share = 0.177 + 0.000823 * h
    sigma_w = 0.1 * _WIND_AT_20_FT_KT[intensity] * _KNOT_M_S
    sigma, length = sigma_w / share**0.4, h / share**1.2 * _FOOT_M
    return Dryden(
        sigma_u_m_s=sigma,
        sigma_v_m_s=sigma,
        sigma_w_m_s=sigma_w,
        length_u_m=length,
        length_v_m=length,
        length_w_m=h * _FOOT_M,
    )


def new_turbulence(model: Dryden, span_m: float) -> np.void:
    """Return turbulence before its start, dtype `TURBULENCE`, for an aircraft of a span [m]."""
    record: np.void = np.zeros(1, TURBULENCE)[0]
    record["sigma"] = model.sigma_u_m_s, model.sigma_v_m_s, model.sigma_w_m_s
    record["length"] = model.length_u_m, model.length_v_m, model.length_w_m
    record["span"] = span_m
    return record


@compiled
def start_turbulence(air: np.void, V: float, seed: int, aircraft: int) -> None:
    """Draw a first state from the stationary distribution.

    Args:
        air: Record of dtype `TURBULENCE`, updated in place.
        V: Airspeed [m/s].
        seed: Seed of the simulation.
        aircraft: System id.
    """
    for axis in range(3):
        n1 = normal(seed, aircraft, _CHANNEL + 2 * axis, 0)
        n2 = normal(seed, aircraft, _CHANNEL + 2 * axis + 1, 0)
        air["first"][axis] = math.sqrt(0.5) * n1
        air["second"][axis] = math.sqrt(0.125) * (n1 + n2)
    air["roll"] = normal(seed, aircraft, _CHANNEL + 1, 0)  # u has no second lag
    _read_velocity(air)
    air["smooth"][0], air["smooth"][1] = air["velocity"][1], air["velocity"][2]
    _read_rates(air, V)


@apart(air=TURBULENCE)
def advance_turbulence(
    air: np.void, V: float, dt: float, seed: int, aircraft: int, step: int
) -> None:
    """Advance turbulence by one period.

    Args:
        air: Record of dtype `TURBULENCE`, updated in place.
        V: Airspeed [m/s].
        dt: Length of the period [s].
        seed: Seed of the simulation.
        aircraft: System id.
        step: Step at which the period ends, 1 or greater.
    """
    if V < STILL_M_S:  # an aircraft that stands stays where it is in eddies that stay as they are
        return
    for axis in range(3):
        a = V * dt / air["length"][axis]
        decay = math.exp(-a)
        first, second = air["first"][axis], air["second"][axis]
        # covariance of what the noise of the period adds to the two lags, and its root
        first_rms = math.sqrt(_moment(0, a))
        common = _moment(1, a) / first_rms
        own = math.sqrt(max(_moment(2, a) - common * common, 0.0))
        n1 = normal(seed, aircraft, _CHANNEL + 2 * axis, step)
        air["first"][axis] = decay * first + first_rms * n1
        if axis > 0:
            n2 = normal(seed, aircraft, _CHANNEL + 2 * axis + 1, step)
            air["second"][axis] = decay * (second + a * first) + common * n1 + own * n2
    a = math.pi * V * dt / (4.0 * air["span"])
    roll_rms = math.sqrt(-math.expm1(-2.0 * a))
    air["roll"] = math.exp(-a) * air["roll"] + roll_rms * normal(seed, aircraft, _CHANNEL + 1, step)
    v, w = air["velocity"][1], air["velocity"][2]
    _read_velocity(air)
    air["smooth"][0] = _lagged(air["smooth"][0], v, air["velocity"][1], 4.0 / 3.0 * a)
    air["smooth"][1] = _lagged(air["smooth"][1], w, air["velocity"][2], a)
    _read_rates(air, V)


@compiled
def _read_velocity(air: np.void) -> None:
    air["velocity"][0] = air["sigma"][0] * math.sqrt(2.0) * air["first"][0]
    for axis in range(1, 3):  # (1 + √3 s) / (1 + s)² = √3 / (1 + s) + (1 - √3) / (1 + s)²
        shaped = _ROOT_3 * air["first"][axis] + (1.0 - _ROOT_3) * air["second"][axis]
        air["velocity"][axis] = air["sigma"][axis] * shaped


@compiled
def _read_rates(air: np.void, V: float) -> None:
    b, length = air["span"], air["length"][2]
    root = (math.pi * length / (4.0 * b)) ** (1.0 / 6.0)
    sigma_p = air["sigma"][2] * math.pi * math.sqrt(0.1 / (b * length)) * root
    air["rates"][0] = sigma_p * air["roll"]
    air["rates"][1] = -math.pi / (4.0 * b) * (air["velocity"][2] - air["smooth"][1])
    air["rates"][2] = math.pi / (3.0 * b) * (air["velocity"][1] - air["smooth"][0])


@compiled
def _lagged(y: float, before: float, after: float, a: float) -> float:
    """Return the output of a lag after a period of `a` time constants, over a linear input."""
    decay = math.exp(-a)
    mean = -math.expm1(-a) / a
    return decay * y + (mean - decay) * before + (1.0 - mean) * after


@compiled
def _moment(k: int, a: float) -> float:
    """Return the integral of s^k exp(-2 s) from 0 to a, by a series of positive terms."""
    term = 1.0 / (k + 1.0)
    total, power, j = term, a, 1
    for _ in range(k):
        power *= a
    while term > 1e-17 * total:
        term *= 2.0 * a / (k + 1.0 + j)
        total += term
        j += 1
    return power * math.exp(-2.0 * a) * total

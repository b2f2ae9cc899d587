"""Cascaded loops as ArduPilot and PX4 fly them: attitude, rate and airspeed, each on its own.

Attitude errors ask for Euler angle rates, these for body rates, and a PI loop with feed-forward
per body axis for surface deflections, scaled with airspeed; another one holds the airspeed.
It uses no aircraft model, no neighbours, no fault information and no trigger.
"""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np

from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import R2
from sitl_plant.airframe.stops import range_of
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import Vec3, clamp, mul, square

_TimeConstant = Annotated[float, quantity("s", "Time constant of an attitude loop.", gt=0.0)]
_RateLimit = Annotated[float, quantity("deg/s", "Limit of an Euler angle's rate.", gt=0.0)]
_RateGain = Annotated[float, quantity("s", "Gain from rate to deflection.", ge=0.0)]
_IntegralGain = Annotated[float, quantity("", "Gain from angle to deflection.", ge=0.0)]
_IntegralLimit = Annotated[float, quantity("deg", "Limit of an integral's deflection.", gt=0.0)]


class Pid(LawParameters):
    """Cascaded loops of angles, rates and airspeed, as in the autopilots of today.

    Choose it as the yardstick that everybody knows, or for an aircraft of which little is known.

    Triples are roll, pitch, yaw.
    A positive surface deflection makes a negative moment, which the law's signs account for:
    gains are positive. The defaults give the rate loops of the paper's aircraft the bandwidth
    of Table III's K2 at 45 m/s (45 rad/s), the speed loop the one of c_v (10 rad/s), feed-forward
    against the damping, and integrals a tenth of a second (speed: half a second).

    Attributes:
        kind: Name of the law.
        time_constant_s: Time constants of the attitude loops [s].
        rate_limit_deg_s: Limits of the Euler angle rates [deg/s].
        rate_ff: Deflection per commanded rate [rad per rad/s].
        rate_p: Deflection per rate error [rad per rad/s].
        rate_i: Deflection per integrated rate error [rad per rad].
        integral_limit_deg: Limits of the integrals' deflections [deg].
        trim_airspeed_m_s: Airspeed at which the rate gains hold.
        thrust_trim_n: Thrust in cruise.
        speed_p_n_s_m: Gain of the speed error.
        speed_i_n_m: Gain of its integral.
    """

    PAGE: ClassVar[str] = "explanation/controllers.md"
    STATE: ClassVar[np.dtype] = np.dtype(
        [("integral", "f8", (3,)), ("thrust_integral", "f8")]  # rad, N
    )

    kind: Literal["pid"] = "pid"

    time_constant_s: tuple[_TimeConstant, _TimeConstant, _TimeConstant] = (
        0.2,
        0.2,
        0.2,
    )  # the least that PX4 permits
    rate_limit_deg_s: tuple[_RateLimit, _RateLimit, _RateLimit] = (60.0, 60.0, 60.0)
    rate_ff: tuple[_RateGain, _RateGain, _RateGain] = (0.08, 0.08, 0.08)
    rate_p: tuple[_RateGain, _RateGain, _RateGain] = (0.37, 0.68, 1.67)
    rate_i: tuple[_IntegralGain, _IntegralGain, _IntegralGain] = (3.7, 6.8, 16.7)
    integral_limit_deg: tuple[_IntegralLimit, _IntegralLimit, _IntegralLimit] = (
        30.0,
        30.0,
        30.0,
    )  # the rudder's trim is 20.3 deg
    trim_airspeed_m_s: float = quantity("m/s", default=45.0, gt=0.0)
    thrust_trim_n: float = quantity("N", default=900.0, ge=0.0)
    speed_p_n_s_m: float = quantity("N s/m", default=206.0, ge=0.0)
    speed_i_n_m: float = quantity("N/m", default=400.0, ge=0.0)

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: it holds the heading by a rudder."""
        if not aircraft.has("rudder"):
            yield "the aircraft has no rudder to hold the heading"


@apart(aircraft=AIRCRAFT, gains=Pid.record(), state=Pid.STATE)
def pid_law(now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void) -> Command:
    """Evaluate the loops and advance their integrals, which stop while an actuator is at its stop.

    Args:
        now: The present step.
        aircraft: Nominal aircraft; only its limits are used.
        gains: Parameters, record made of `Pid`.
        state: Record of dtype `Pid.STATE`, updated in place.
    """
    motion, e = now.motion, now.errors.e
    commanded = mul(
        R2(motion.phi),
        (_rate(e[0], 0, gains), _rate(e[1], 1, gains), _rate(e[2], 2, gains)),
    )
    scaling = gains["trim_airspeed_m_s"] / motion.V
    delta = (
        _surface(0, commanded, motion.omega, scaling, aircraft, now.dt, gains, state),
        _surface(1, commanded, motion.omega, scaling, aircraft, now.dt, gains, state),
        _surface(2, commanded, motion.omega, scaling, aircraft, now.dt, gains, state),
    )
    V_error = -now.errors.V_tilde
    T = gains["thrust_trim_n"] + gains["speed_p_n_s_m"] * V_error + state["thrust_integral"]
    most = available_thrust(motion.V, aircraft)
    winds_up = (T <= 0.0 and V_error < 0.0) or (most <= T and V_error > 0.0)
    if not winds_up:
        state["thrust_integral"] += now.dt * gains["speed_i_n_m"] * V_error
    return Command(delta, T, ALL)


@compiled
def _rate(e: float, axis: int, gains: np.void) -> float:
    """Return the Euler angle rate that an attitude error asks for, within its limit [rad/s]."""
    limit: float = gains["rate_limit_rad_s"][axis]
    asked: float = -e / gains["time_constant_s"][axis]
    return clamp(asked, -limit, limit)


@compiled
def _surface(
    axis: int,
    commanded: Vec3,
    omega: Vec3,
    scaling: float,
    aircraft: AircraftRecord,
    dt: float,
    gains: np.void,
    state: np.void,
) -> float:
    """Return the deflection of one surface [rad].

    Moments grow with V², damping by the rates with V.
    """
    error = commanded[axis] - omega[axis]
    proportional: float = gains["rate_p"][axis] * error + state["integral"][axis]
    delta: float = -(
        scaling * gains["rate_ff"][axis] * commanded[axis] + square(scaling) * proportional
    )
    lowest, highest = range_of(aircraft, axis)
    winds_up = (delta <= lowest and error > 0.0) or (delta >= highest and error < 0.0)
    if not winds_up:
        limit = gains["integral_limit_rad"][axis]
        grown = state["integral"][axis] + dt * gains["rate_i"][axis] * error
        state["integral"][axis] = clamp(grown, -limit, limit)
    return delta

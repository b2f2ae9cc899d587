"""The controller on the ground, in place of the control law.

Attitude is held by the inversion of the nominal model's moments, as far as the surfaces reach: what
the air does to the heading in a crosswind is balanced before it turns the aircraft. The steered
wheel follows the rudder's channel. Both together are taken for a moment that grows evenly up to the
stop: the air's, which grows with V², and the wheel's grip, which goes with the weight that the wing
does not carry yet, 1 - (V/V_R)². The rate of turn is held with that, and what tyres do by an
integral.
"""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.step import ALL, Command, Step
from ftc_autopilot.guidance.runway import RUNWAY_FIGURES
from ftc_autopilot.guidance.runway_phases import RUNWAY_STATE, STANDING, STOPPED
from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.vec3 import clamp, mul, square

_STIFFNESS = 2.0
"""Bandwidth of the attitude, relative to the one of the reference filter."""
_TURNING = 0.5
"""Of the heading."""
_MOST_INTEGRAL = math.radians(20.0)
"""Largest pitch error that the integral stands for [rad]."""
_LEAST_SHARE = 0.3
"""Airspeed below which the air is asked for less, relative to the one of the rotation."""


@apart(aircraft=AIRCRAFT, asked=RUNWAY_STATE, figures=RUNWAY_FIGURES)
def ground_law(now: Step, aircraft: AircraftRecord, asked: np.void, figures: np.void) -> Command:
    """Return the commands that hold heading and attitude, and the thrust asked for.

    Args:
        now: The step.
        aircraft: Nominal aircraft, dtype `sitl_plant.airframe.aircraft.AIRCRAFT`.
        asked: Record of dtype `ftc_autopilot.guidance.runway_phases.RUNWAY_STATE`; its integrals
            are advanced.
        figures: Record of dtype `ftc_autopilot.guidance.runway.RUNWAY_FIGURES`.
    """
    if asked["phase"] in (STANDING, STOPPED):
        return Command((0.0, 0.0, 0.0), 0.0, ALL)
    motion, k = now.motion, _STIFFNESS * now.bandwidth
    roll, pitch, yaw = motion.phi
    p, q, r = motion.omega
    felt = min(square(motion.V / (_LEAST_SHARE * figures["rotate"])), 1.0)
    error = asked["pitch"] - pitch
    limit = _MOST_INTEGRAL / k
    if asked["brake"] == 0.0:  # brakes pitch it down
        grown = asked["pitch_integral"] + felt * error * now.dt
        asked["pitch_integral"] = clamp(grown, -limit, limit)
    turn = _TURNING * now.bandwidth * wrap(asked["heading"] - yaw)
    demand = (
        -square(k) * roll - 2.0 * k * p,
        square(k) * (error + k * asked["pitch_integral"]) - 2.0 * k * q,
        0.0,
    )
    J = aircraft["J"]
    rows = (
        (J[0, 0], J[0, 1], J[0, 2]),
        (J[1, 0], J[1, 1], J[1, 2]),
        (J[2, 0], J[2, 1], J[2, 2]),
    )
    moment = mul(rows, demand)
    N, C = motion.air.N, motion.air.C
    L, M, n = felt * moment[0] - N[0], felt * moment[1] - N[1], -N[2]
    aileron, rudder = _paired(L, n, C)
    elevator = M / C[1][1] if C[1][1] != 0.0 else 0.0
    stop = min(-aircraft["stops"][2, 0], aircraft["stops"][2, 1])
    by_air = abs(C[2][2]) * stop
    by_wheel = figures["grip"] * max(1.0 - square(motion.V / figures["rotate"]), 0.0)
    if by_air + by_wheel > 0.0:
        rudder *= by_air / (by_air + by_wheel)
        side = 1.0 if C[2][2] > 0.0 or figures["steering"] > 0.0 else -1.0
        gain = side * stop * k * J[2, 2] / (by_air + by_wheel)
        if asked["brake"] == 0.0 or _LEAST_SHARE * figures["rotate"] < motion.V:
            grown = asked["turn_integral"] + gain * now.bandwidth * (turn - r) * now.dt
            asked["turn_integral"] = clamp(grown, -stop, stop)
        rudder += asked["turn_integral"] + gain * (turn - r)
    return Command((aileron, elevator, rudder), float(asked["thrust"]), ALL)


@compiled
def _paired(L: float, n: float, C: tuple[tuple[float, float, float], ...]) -> tuple[float, float]:
    """Return aileron and rudder [rad] that make a rolling and a yawing moment [N m]."""
    a, b, c, d = C[0][0], C[0][2], C[2][0], C[2][2]
    if d == 0.0:
        return (L / a if a != 0.0 else 0.0), 0.0
    determinant = a * d - b * c
    if determinant == 0.0:
        return 0.0, n / d
    return (d * L - b * n) / determinant, (a * n - c * L) / determinant

"""What an aircraft does near a runway: its stall, its glide without thrust, its rolls."""

import math

from ftc_autopilot.guidance.laws.base import GuidanceParameters
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics, thrust
from sitl_plant.airframe.aircraft import AircraftRecord

ROTATE = 1.15
"""Airspeed at which it rotates, relative to V_s."""
STEEPEST_SHARE = 0.8
"""Slope of the steepest approach, relative to the one of an idling engine."""
_STEPS = 50
_ROTATION_S = 2.0
_LEAST_BRAKING = 0.05

# a ground station that checks a scenario does not wait for numba
carried_linearly = in_python(aerodynamics.carried_linearly)
drag_of = in_python(aerodynamics.drag)
_available_thrust = in_python(thrust.available_thrust)
_aerodynamics = in_python(aerodynamics.aerodynamics)


def glide_of(
    record: AircraftRecord, stall: float, slowest: float, fastest: float, flare: float, end: float
) -> tuple[float, float]:
    """Return airspeed and sink of a glide without thrust.

    It is so fast that its slope has a reserve over the one at the slowest airspeed, and that what
    the flare takes of it, by the drag, leaves enough for touchdown.

    Args:
        record: The aircraft.
        stall: V_s.
        slowest: Airspeed of the approach.
        fastest: Greatest airspeed.
        flare: Time constant of the flare.
        end: Sink at touchdown.
    """
    weight = float(record["m"] * record["g"])
    at_zero, rise = carried_linearly(record)
    least = math.inf
    for k in range(_STEPS + 1):
        V = slowest + (fastest - slowest) * k / _STEPS
        area = 0.5 * float(record["rho"]) * V**2 * float(record["S"])
        slope = float(drag_of(area, (weight / area - at_zero) / rise, record)) / weight
        least = min(least, slope)
        lost = slope * float(record["g"]) * flare * math.log(max(V * slope / end, 1.0))
        if slope >= least / STEEPEST_SHARE and V - lost >= ROTATE * stall:
            break
    return V, V * math.sin(math.atan(slope))


def stall_airspeed(record: AircraftRecord, incidence: float) -> float:
    """Return V_s: by the greatest lift up to the stall, or up to an angle of attack [rad]."""
    highest = float(record["stall"]) or incidence
    angles = (highest * k / _STEPS for k in range(1, _STEPS + 1))
    most = max(_lift(alpha, record) for alpha in angles)
    weight, area = record["m"] * record["g"], 0.5 * record["rho"] * record["S"]
    return math.sqrt(float(weight / (area * max(most, 1e-6))))


def _lift(alpha: float, record: AircraftRecord) -> float:
    """Return the force across the flight path in level flight by q S, the stall included.

    The thrust balances the drag, and carries its part of the weight.
    """
    across = (math.cos(alpha), 0.0, math.sin(alpha))
    x, _, z = _aerodynamics(across, (0.0, 0.0, 0.0), record).F
    lift = x * math.sin(alpha) - z * math.cos(alpha)
    drag = -x * math.cos(alpha) - z * math.sin(alpha)
    return float((lift + drag * math.tan(alpha)) / (0.5 * record["rho"] * record["S"]))


def take_off_roll(
    record: AircraftRecord,
    guidance: GuidanceParameters,
    acceleration: float,
    rotate: float,
    rolling: float,
) -> float:
    """Return the length of a take-off from wheels [m]; infinite if thrust does not suffice."""
    length, dV = 0.0, rotate / _STEPS
    for k in range(_STEPS):
        V = (k + 0.5) * dV
        area = 0.5 * float(record["rho"]) * V**2 * float(record["S"])
        force = guidance.thrust_share_max * float(_available_thrust(V, record))
        force -= float(drag_of(area, 0.0, record))
        a = min(force / float(record["m"]) - rolling * float(record["g"]), acceleration)
        if a <= 0.0:
            return math.inf
        length += V * dV / a
    return length + _ROTATION_S * rotate


def landing_roll(record: AircraftRecord, approach: float, braking: float) -> float:
    """Return the length from touchdown to standstill [m], by drag and brakes."""
    length, dV = 0.0, approach / _STEPS
    for k in range(_STEPS):
        V = (k + 0.5) * dV
        area = 0.5 * float(record["rho"]) * V**2 * float(record["S"])
        slower = float(drag_of(area, 0.0, record)) / float(record["m"])
        length += V * dV / (slower + max(braking, _LEAST_BRAKING) * float(record["g"]))
    return length

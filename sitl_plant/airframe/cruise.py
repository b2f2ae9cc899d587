"""Figures of an aircraft in level flight at its cruise, from which others' parameters follow."""

import math
from typing import NamedTuple

from mavlink_defs.constants import AILERON, ELEVATOR
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

_aerodynamics = in_python(aerodynamics.aerodynamics)
_longitudinal = in_python(aerodynamics.longitudinal)
_lift_coefficient = in_python(aerodynamics.lift_coefficient)
_rate_damping = in_python(aerodynamics.rate_damping)
_CIRCLE_BANK_DEG = 25.0


class DerivedParameter(NamedTuple):
    """A parameter of a foreign autopilot, and why it has this value."""

    name: str
    value: float
    why: str


class CruiseFigures(NamedTuple):
    """What an autopilot asks of an aircraft.

    Attributes:
        airspeed: Cruise [m/s].
        pitch_deg: Angle of attack of level flight [deg].
        thrust: Its share of the full thrust.
        climb_m_s: Climb that the rest of the thrust could give [m/s].
        sink_m_s: Sink without thrust [m/s].
        circle_m: Radius of a circle [m].
        roll_travel: Part of the aileron's travel that a steady roll of 1 rad/s takes.
        pitch_travel: The same of the elevator's and a steady pull-up, whose lift takes an angle of
            attack.
    """

    airspeed: float
    pitch_deg: float
    thrust: float
    climb_m_s: float
    sink_m_s: float
    circle_m: float
    roll_travel: float
    pitch_travel: float


def cruise_figures(aircraft: Aircraft) -> CruiseFigures:
    """Return the figures of an aircraft."""
    V, record = aircraft.design_airspeed, aircraft_record(aircraft)
    weight = float(record["m"] * record["g"])
    pressed = 0.5 * float(record["rho"] * record["S"]) * V**2  # dynamic pressure by area [N]
    level = _longitudinal(V, 0.0, record)
    alpha = (weight - pressed * _lift_coefficient(0.0, record)) / level.lift_by_alpha
    drag = _longitudinal(V, alpha, record).drag
    rolling, _ = _rate_damping(V, record)
    pull_up = level.moment_by_alpha * float(record["m"]) * V / level.lift_by_alpha
    return CruiseFigures(
        airspeed=V,
        pitch_deg=math.degrees(alpha),
        thrust=min(max(drag / aircraft.thrust_limit_n, 0.0), 1.0),
        climb_m_s=max((aircraft.thrust_limit_n - drag) * V / weight, 0.5),
        sink_m_s=max(drag * V / weight, 0.5),
        circle_m=V**2 / (float(record["g"]) * math.tan(math.radians(_CIRCLE_BANK_DEG))),
        roll_travel=_travel(aircraft, AILERON, rolling, V),
        pitch_travel=_travel(aircraft, ELEVATOR, pull_up + level.moment_by_q, V),
    )


def _travel(aircraft: Aircraft, surface: int, moment: float, V: float) -> float:
    """Return which part of its travel a surface takes to balance a moment [N m]."""
    C = _aerodynamics((V, 0.0, 0.0), (0.0, 0.0, 0.0), aircraft_record(aircraft)).C
    low, high = aircraft.stops_deg[surface]
    travel = math.radians(min(-low, high)) or 1.0
    effect = C[surface][surface]
    return (abs(moment / effect) if effect else 1.0) / travel

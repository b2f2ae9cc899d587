"""Figures of an aircraft in level flight at its cruise, from which others' parameters follow."""

import math
from typing import NamedTuple

from sitl_plant.airframe.config import Aircraft

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
    cruise, g = aircraft.design_airspeed, aircraft.gravity_m_s2 or 9.81
    pressure = 0.5 * aircraft.air_density_kg_m3 * cruise**2 * aircraft.wing_area_m2
    C = aircraft.coefficients
    alpha = (aircraft.mass_kg * g / pressure - C.cL0) / C.cL_alpha
    drag = pressure * (C.cD0 + C.cD_alpha * alpha + C.cD_alpha2 * alpha**2)
    specific = cruise / (aircraft.mass_kg * g)
    return CruiseFigures(
        airspeed=cruise,
        pitch_deg=math.degrees(alpha),
        thrust=min(max(drag / aircraft.thrust_limit_n, 0.0), 1.0),
        climb_m_s=max((aircraft.thrust_limit_n - drag) * specific, 0.5),
        sink_m_s=max(drag * specific, 0.5),
        circle_m=cruise**2 / (g * math.tan(math.radians(_CIRCLE_BANK_DEG))),
        roll_travel=_roll_travel(aircraft),
        pitch_travel=_pitch_travel(aircraft, pressure),
    )


def _roll_travel(aircraft: Aircraft) -> float:
    C = aircraft.coefficients
    reduced = _per_rate(aircraft, aircraft.wing_span_m)
    deflection = abs(C.cl_p * reduced / C.cl_da) if C.cl_da else 1.0
    return deflection / _travel(aircraft.stops_deg[0])


def _pitch_travel(aircraft: Aircraft, pressure: float) -> float:
    C = aircraft.coefficients
    reduced = _per_rate(aircraft, aircraft.mean_chord_m)
    alpha = aircraft.mass_kg * aircraft.design_airspeed / (pressure * C.cL_alpha)
    moment = C.cm_alpha * alpha + C.cm_q * reduced
    deflection = abs(moment / C.cm_de) if C.cm_de else 1.0
    return deflection / _travel(aircraft.stops_deg[1])


def _per_rate(aircraft: Aircraft, length: float) -> float:
    """Return what a derivative by a rate is multiplied by for 1 rad/s."""
    nondimensional = aircraft.rate_derivatives == "nondimensional"
    return length / (2.0 * aircraft.design_airspeed) if nondimensional else 1.0


def _travel(stops_deg: tuple[float, float]) -> float:
    return math.radians(min(-stops_deg[0], stops_deg[1])) or 1.0

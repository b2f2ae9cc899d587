"""Figure of an aircraft's polar: lift and drag by angle of attack, and by each other."""

import math
from typing import TYPE_CHECKING

import numpy as np

from gcs.reports.figures.style import draw_legend, new_figure, style, tidy
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import LevelFlight

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MIN_DEG, _MAX_DEG = -10.0, 20.0  # without a stall
_BEYOND_DEG = 15.0  # of the stall
_POINTS = 301


def polar(aircraft: Aircraft, alpha_deg: np.ndarray) -> np.ndarray:
    """Return lift and drag coefficients without sideslip, rotation and deflections.

    Args:
        aircraft: The aircraft.
        alpha_deg: Angles of attack [deg], shape (n,).

    Returns:
        C_L and C_D, shape (2, n).
    """
    record = aircraft_record(aircraft)
    pressure = 0.5 * aircraft.air_density_kg_m3 * aircraft.wing_area_m2  # at 1 m/s
    curves = np.empty((2, len(alpha_deg)))
    for k, alpha in enumerate(np.radians(alpha_deg)):
        ca, sa = math.cos(alpha), math.sin(alpha)
        x, _, z = aerodynamics((ca, 0.0, sa), (0.0, 0.0, 0.0), record).F
        curves[:, k] = (x * sa - z * ca) / pressure, -(x * ca + z * sa) / pressure
    return curves


def draw_polar(aircraft: Aircraft, flight: LevelFlight) -> "Figure":
    """Draw lift and drag, with a level flight and the flattest glide marked.

    Args:
        aircraft: The aircraft.
        flight: The level flight, of which the angle of attack is marked.
    """
    highest = _MAX_DEG
    if aircraft.stall_deg is not None:
        highest = aircraft.stall_deg + _BEYOND_DEG
    alpha = np.linspace(_MIN_DEG, max(highest, flight.alpha_deg + 1.0), _POINTS)
    lift, drag = polar(aircraft, alpha)
    figure = new_figure(3.2)
    left, middle, right = figure.subplots(1, 3)
    left.plot(alpha, lift, color=style(0).colour)
    left.set_ylabel("lift coefficient C_L")
    middle.plot(alpha, drag, color=style(0).colour)
    middle.set_ylabel("drag coefficient C_D")
    right.plot(drag, lift, color=style(0).colour)
    right.set_ylabel("lift coefficient C_L")
    right.set_xlabel("drag coefficient C_D")
    flown = np.array([flight.alpha_deg])
    at = f"level flight at {flight.airspeed_m_s:g} m/s"
    points = [(at, "o", flown)]
    ratio = np.divide(lift, drag, out=np.zeros_like(lift), where=drag > 0.0)
    best = int(np.argmax(ratio))
    if 0 < best < _POINTS - 1:  # a maximum, not an end: without a polar there is none
        points.append((f"flattest glide, C_L/C_D = {ratio[best]:.1f}", "^", alpha[best : best + 1]))
    for i, (label, marker, angle) in enumerate(points):
        by_lift, by_drag = polar(aircraft, angle)
        look = {"marker": marker, "linestyle": "none", "color": style(i + 1).colour}
        left.plot(angle, by_lift, label=label, **look)
        middle.plot(angle, by_drag, label=label, **look)
        right.plot(by_drag, by_lift, label=label, **look)
    for panel in (left, middle):
        panel.set_xlabel("angle of attack [deg]")
        if aircraft.stall_deg is not None:
            panel.axvline(aircraft.stall_deg, color="0.6", linewidth=0.8, label="stall")
    for panel in (left, middle, right):
        tidy(panel)
    draw_legend(figure)
    return figure

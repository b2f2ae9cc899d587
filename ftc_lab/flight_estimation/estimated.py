"""An estimate of a recorded flight, and what is said of it."""

from dataclasses import dataclass

import numpy as np

from ftc_lab.flight_estimation.follow import FollowedFlight, follow_flight, latency_by
from ftc_lab.flight_estimation.judged import JudgedEstimate, judge_estimate
from ftc_lab.flight_estimation.samples import Compass, flown_span, samples_of
from gcs.results.logs.table import FlightTable
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe.aerodynamics import lift_coefficient
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.sensing.config import NavigationSensors

_lift_coefficient = in_python(lift_coefficient)
_ANY = "aerosonde"  # whose shape an unknown aircraft is taken to have
_USUAL_ALPHA = 0.05  # rad, at which an aircraft cruises
_SLOWEST, _FASTEST = 0.65, 1.5  # of the usual airspeed
_PASSES, _ENOUGH_S = 3, 0.01  # in which a latency is found, and how well
_SHOWING_S = 400.0  # of flight, in which it is found
_USUAL_M_S = 18.0  # without an airspeed in the log


@dataclass(frozen=True)
class FlightEstimate:
    """An estimate.

    Attributes:
        followed: What the filter made of the flight.
        judged: What is said of it.
        latency_s: By which fixes were taken to be old.
        shown_s: Their latency as the flight shows it; None: it does not.
        learnt_s: Latency by the filter's own learning.
        remarks: What was taken for what, and what is missing.
    """

    followed: FollowedFlight
    judged: JudgedEstimate
    latency_s: float
    shown_s: float | None
    learnt_s: float
    remarks: tuple[str, ...]


def estimate_flight(
    flight: FlightTable,
    aircraft: Aircraft | None = None,
    latency_s: float | None = None,
    compass: Compass = "calibrated",
    sensors: NavigationSensors | None = None,
    within_s: tuple[float | None, float | None] = (None, None),
) -> FlightEstimate:
    """Estimate a recorded flight by its sensors, as an autopilot would have.

    Args:
        flight: The log.
        aircraft: As it is known; None: one of which the lift is known at its usual airspeed only.
        latency_s: How old fixes are when the log has them; None: as the flight shows it.
        compass: How the magnetometer's readings are taken.
        sensors: What the filter is to assume of them; None: what it should of real ones.
        within_s: From when to when; None: from take-off, to touch-down.

    Raises:
        BadInput: There is no IMU, no receiver or no flight in the log.
    """
    span_s = flown_span(flight, *within_s)
    own = aircraft or _any_aircraft(flight)
    taken = latency_s or 0.0
    showing_s = (span_s[0], min(span_s[1], span_s[0] + _SHOWING_S))
    if latency_s is not None:
        showing_s = span_s
    for _ in range(_PASSES):
        samples = samples_of(flight, showing_s, taken, compass, sensors)
        followed = follow_flight(samples, own)
        shown = latency_by(followed, own.gravity_m_s2)
        if shown is None and showing_s != span_s:  # it does not turn at first
            showing_s = span_s
            continue
        if latency_s is not None or shown is None or abs(shown - taken) < _ENOUGH_S:
            break
        taken = round(min(max(shown, 0.0), 1.0), 3)
    if showing_s != span_s:
        samples = samples_of(flight, span_s, taken, compass, sensors)
        followed = follow_flight(samples, own)
    remarks = list(samples.remarks)
    if aircraft is None:
        remarks.append(
            "no --aircraft: its side force says nothing of sideslip, and the lift is guessed"
        )
    learnt = taken + float(followed.reports["delay"][-1])
    return FlightEstimate(
        followed, judge_estimate(followed, flight), taken, shown, learnt, tuple(remarks)
    )


def _any_aircraft(flight: FlightTable) -> Aircraft:
    """Return an aircraft that carries itself at the log's usual airspeed."""
    V, known = _USUAL_M_S, flight.airspeed
    if known is not None:
        V = float(np.median(known.values[known.values > 0.5 * np.percentile(known.values, 90.0)]))
    found = load_aircraft(_ANY)
    lift = (
        0.5
        * found.air_density_kg_m3
        * V**2
        * _lift_coefficient(_USUAL_ALPHA, aircraft_record(found))
    )
    update = {
        "coefficients": found.coefficients.without_side_force(),
        "wing_area_m2": found.mass_kg * found.gravity_m_s2 / lift,
        "cruise_m_s": V,
        "airspeed_min_m_s": _SLOWEST * V,
        "airspeed_max_m_s": _FASTEST * V,
    }
    return found.model_copy(update=update)

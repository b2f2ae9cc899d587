"""An estimate of a recorded flight, and what is said of it."""

from dataclasses import dataclass

import numpy as np

from ftc_lab.flight_estimation.follow import FollowedFlight, follow_flight
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
_USUAL_M_S = 18.0  # without an airspeed in the log


@dataclass(frozen=True)
class FlightEstimate:
    """An estimate.

    Attributes:
        followed: What the filter made of the flight.
        judged: What is said of it.
        latency_s: By which fixes were taken to be old.
        learnt_s: How old they were, as the filter has learnt from the flight.
        learnt_std_s: Standard deviation of that, by the filter.
        remarks: What was taken for what, and what is missing.
    """

    followed: FollowedFlight
    judged: JudgedEstimate
    latency_s: float
    learnt_s: float
    learnt_std_s: float
    remarks: tuple[str, ...]


def estimate_flight(
    flight: FlightTable,
    aircraft: Aircraft | None = None,
    latency_s: float = 0.0,
    compass: Compass = "calibrated",
    sensors: NavigationSensors | None = None,
    within_s: tuple[float | None, float | None] = (None, None),
) -> FlightEstimate:
    """Estimate a recorded flight by its sensors, as an autopilot would have.

    Args:
        flight: The log.
        aircraft: As it is known; None: one of which the lift is known at its usual airspeed only.
        latency_s: How old fixes are when the log has them, about: the filter learns it.
        compass: How the magnetometer's readings are taken.
        sensors: What the filter is to assume of them; None: what it should of real ones.
        within_s: From when to when; None: from take-off, to touch-down.

    Raises:
        BadInput: There is no IMU, no receiver or no flight in the log.
    """
    own = aircraft or _any_aircraft(flight)
    samples = samples_of(flight, flown_span(flight, *within_s), latency_s, compass, sensors)
    followed = follow_flight(samples, own)
    remarks = list(samples.remarks)
    if aircraft is None:
        remarks.append(
            "no --aircraft: its side force says nothing of sideslip, and the lift is guessed"
        )
    last = followed.reports[-1]
    learnt, std = latency_s + float(last["delay"]), float(last["delay_std"])
    judged = judge_estimate(followed, flight)
    return FlightEstimate(followed, judged, latency_s, learnt, std, tuple(remarks))


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

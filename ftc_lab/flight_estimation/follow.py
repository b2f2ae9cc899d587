"""The estimator of the autopilot, step by step over recorded samples."""

from dataclasses import dataclass

import numpy as np

from ftc_autopilot.estimation.estimator import EstimatorConfig, estimate, new_estimator
from ftc_autopilot.estimation.output import REPORT
from ftc_autopilot.estimation.state import N_SENSORS
from ftc_lab.flight_estimation.samples import RecordedSamples
from mavlink_defs.framing.codec import SIM_STATE, SIM_STEP
from sitl_plant.airframe.config import Aircraft


@dataclass(frozen=True)
class FollowedFlight:
    """What the estimator made of n steps.

    Attributes:
        samples: Of the steps.
        states: FTC_SIM_STATE, shape (n,): what a law would have flown by.
        reports: Of the estimator, dtype `REPORT`, shape (n,).
        fresh: Whether a sensor had a new sample in a step, by its number, shape (n, sensors).
    """

    samples: RecordedSamples
    states: np.ndarray
    reports: np.ndarray
    fresh: np.ndarray


def follow_flight(samples: RecordedSamples, aircraft: Aircraft) -> FollowedFlight:
    """Let the estimator follow recorded samples.

    Args:
        samples: What the sensors reported.
        aircraft: The nominal aircraft: gravity, density of the air, lift and side force.
    """
    config = EstimatorConfig(samples.sensors, samples.origin, samples.step_us, aircraft)
    estimator, n = new_estimator(config), len(samples.time_s)
    states, reports = np.zeros(n, SIM_STATE), np.zeros(n, REPORT)
    fresh = np.zeros((n, N_SENSORS), bool)
    record, sim_step, times = estimator.state[0], np.zeros(1, SIM_STEP)[0], samples.time_us
    for k in range(n):
        sim_step["step"], sim_step["time_usec"] = samples.number[k], times[k]
        has_fix = bool(samples.has_fix[k])
        imu, gps = samples.imus[k : k + 1], samples.gps[k]
        estimate(record, estimator.history, imu, gps, has_fix, sim_step, states[k])
        reports[k] = record["report"]
        fresh[k] = record["sensors"]["fresh"]
    return FollowedFlight(samples, states, reports, fresh)

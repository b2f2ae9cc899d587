"""The estimator of the autopilot, step by step over recorded samples."""

from dataclasses import dataclass

import numpy as np

from ftc_autopilot.estimation.estimator import EstimatorConfig, estimate, new_estimator
from ftc_autopilot.estimation.output import REPORT
from ftc_autopilot.estimation.state import N_SENSORS
from ftc_lab.flight_estimation.samples import RecordedSamples
from ftc_lab.flight_signals import to_ned
from mavlink_defs.framing.codec import SIM_STATE, SIM_STEP
from sitl_plant.airframe.config import Aircraft

_LATEST_S, _STEP_S = 0.6, 0.02  # latencies that are tried
_SHOWN = 0.7  # of the usual scatter: a latency that explains less is not shown
_CHANGE_S = 1.0  # over which a change is more than the receiver's noise
_SLOW_S = 5.0  # errors of the velocity that are slower than this are the filter's


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


def latency_by(followed: FollowedFlight, gravity: float) -> float | None:
    """Return how old fixes were when the log had them, by their velocity [s].

    What the receiver's velocity is over the integral of the acceleration changes slowly, but for
    errors of the time. So each latency that is tried gets the scatter about the mean of the last
    seconds, and a parabola through the three best ones has its least where the latency is.

    Args:
        followed: The flight, with attitudes of the filter.
        gravity: [m/s²].

    Returns:
        None if the flight does not turn, and so does not show it.
    """
    samples, step_s = followed.samples, followed.samples.step_us / 1e6
    force = np.stack([samples.imus[name] for name in ("xacc", "yacc", "zacc")], axis=1)
    attitude = followed.states["attitude"]
    good = np.isfinite(attitude).all(axis=1)
    turned = np.einsum("nij,nj->ni", to_ned(np.where(good[:, None], attitude, 0.0)), force)
    turned[:, 2] += gravity
    travel = np.cumsum(turned, axis=0) * step_s
    at = samples.time_s[samples.has_fix]
    velocity = np.stack([samples.gps[name] for name in ("vn", "ve", "vd")], axis=1) / 100.0
    velocity = velocity[samples.has_fix]
    period = float(np.median(np.diff(at)))
    tried = np.arange(-_LATEST_S, _LATEST_S + _STEP_S, _STEP_S)
    scatter = np.array(
        [_scatter(late, at, velocity, samples.time_s, travel, period) for late in tried]
    )
    best = int(np.argmin(scatter))
    if best in (0, len(tried) - 1) or not scatter[best] < _SHOWN * np.median(scatter):
        return None
    before, least, after = scatter[best - 1 : best + 2]
    return float(tried[best] + 0.5 * _STEP_S * (before - after) / (before - 2.0 * least + after))


def _scatter(
    late: float,
    at: np.ndarray,
    velocity: np.ndarray,
    time_s: np.ndarray,
    travel: np.ndarray,
    period: float,
) -> float:
    """Return the mean square of what changes from fix to fix, without what changes slowly."""
    integral = np.stack([np.interp(at - late, time_s, one) for one in travel.T], axis=1)
    off = (velocity - integral)[(at > time_s[0] + _LATEST_S) & (at < time_s[-1] - _LATEST_S)]
    each, width = (max(round(span / period), 1) for span in (_CHANGE_S, _SLOW_S))
    change = off[each:] - off[:-each]  # of accelerometers' biases, too: a mean that is slow
    slow = np.stack([np.convolve(one, np.full(width, 1.0 / width), "same") for one in change.T], 1)
    size = np.sum((change - slow) ** 2, axis=1)
    return float(np.mean(np.sort(size)[: int(0.95 * len(size)) + 1]))

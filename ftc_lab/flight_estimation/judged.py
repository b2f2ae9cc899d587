"""How good an estimate is: against a log's own solution, and against what it expects of itself."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.health import ABSENT, REASONS, WELL
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_VELOCITY
from ftc_lab.flight_estimation.follow import FollowedFlight
from ftc_lab.flight_signals import FlightSignals, to_ned
from gcs.results.logs import names
from gcs.results.logs.table import FlightTable, wrapped
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT

SETTLED_S = 60.0
"""From the first sample: what is before is not judged [s]; of a short flight, half of it."""
AGREE_DEG = {"roll": 5.0, "pitch": 5.0, "yaw": 10.0}
"""Within which 95 % of an estimate must be of the log's own solution to agree with it."""
SENSORS = {  # and how many innovations each has, of which the largest is tested
    "compass": (MAGNETOMETER, 3),
    "barometer": (BAROMETER, 1),
    "pitot tube": (PITOT, 1),
    "GNSS place": (GNSS, 2),
    "GNSS velocity": (GNSS_VELOCITY, 3),
    "GNSS height": (GNSS_HEIGHT, 1),
}
_GRID = np.linspace(0.0, 60.0, 60_001)


class ErrorSize(NamedTuple):
    """Sizes of an error: median, what 95 % are below, the largest; and its unit."""

    median: float
    most_95: float
    largest: float
    unit: str


class NisFigure(NamedTuple):
    """Squared normalised innovations of a sensor.

    Attributes:
        mean: Of the samples that were used.
        expected: Of a filter whose covariance is right.
        bounds: Within which 95 % of means would be then, if samples were independent.
        samples: How many were used.
    """

    mean: float
    expected: float
    bounds: tuple[float, float]
    samples: int


class Exclusion(NamedTuple):
    """A sensor that was not used for a while."""

    sensor: str
    reason: str
    from_s: float
    to_s: float


@dataclass(frozen=True)
class JudgedEstimate:
    """What is said of an estimate.

    Attributes:
        span_s: From when to when it was judged.
        errors: Against the log's own solution, by quantity; empty if it has none.
        expected_deg: Mean standard deviation by the filter itself, of roll, pitch, yaw [deg].
        nis: By sensor.
        exclusions: In the order of time.
        resets: Times that the filter began again, or was set to a fix.
        lost_s: Since when the estimate is no number; None: it never was.
    """

    span_s: tuple[float, float]
    errors: Mapping[str, ErrorSize]
    expected_deg: tuple[float, float, float]
    nis: Mapping[str, NisFigure]
    exclusions: tuple[Exclusion, ...]
    resets: int
    lost_s: float | None

    @property
    def agrees(self) -> bool:
        """Whether the estimate is one, and the log's own solution says the same."""
        apart = (
            self.errors[name].most_95 > most for name, most in AGREE_DEG.items() if self.errors
        )
        return self.lost_s is None and not any(apart)


def differences(followed: FollowedFlight, flight: FlightTable) -> dict[str, tuple[np.ndarray, str]]:
    """Return estimated less recorded, and the unit, by quantity, each of shape (n,)."""
    signals, states = FlightSignals(flight, followed.samples.time_s), followed.states
    found = {}
    for k, name in enumerate(names.ATTITUDE):
        if signals.has(name):
            off = wrapped(states["attitude"][:, k] - signals.of(name), 2.0 * np.pi)
            found[name] = np.degrees(off), "deg"
    estimated = np.einsum("nij,nj->ni", to_ned(states["attitude"]), states["velocity"])
    for k, name in enumerate(names.VELOCITY):
        if signals.has(name):
            found[name] = estimated[:, k] - signals.of(name), "m/s"
    for k, name in enumerate(("wind_north", "wind_east")):
        if signals.has(name):
            found[name] = followed.reports["wind"][:, k] - signals.of(name), "m/s"
    return found


def judge_estimate(followed: FollowedFlight, flight: FlightTable) -> JudgedEstimate:
    """Judge an estimate after it has settled."""
    t, reports = followed.samples.time_s, followed.reports
    begin = t[0] + min(SETTLED_S, 0.5 * (t[-1] - t[0]))
    late = t >= begin
    # a variance below zero is no number here: the filter is lost as well
    number = np.isfinite(followed.states["attitude"]).all(axis=1)
    number &= np.isfinite(reports["attitude_std"]).all(axis=1)
    own = np.degrees(reports["attitude_std"][late & number]).mean(axis=0)
    errors = {}
    for name, (off, unit) in differences(followed, flight).items():
        size = np.abs(off[late & np.isfinite(off)])
        if len(size):
            median, most = np.percentile(size, (50.0, 95.0)).tolist()
            errors[name] = ErrorSize(median, most, float(size.max()), unit)
    return JudgedEstimate(
        (float(begin), float(t[-1])),
        errors,
        (float(own[0]), float(own[1]), float(own[2])),
        {name: found for name, found in _nis(followed, late) if found is not None},
        tuple(_exclusions(followed)),
        int(reports["resets"][-1]),
        None if number.all() else float(t[np.argmin(number)]),
    )


def _nis(followed: FollowedFlight, late: np.ndarray) -> Iterator[tuple[str, NisFigure | None]]:
    reports = followed.reports
    for name, (sensor, count) in SENSORS.items():
        used = late & followed.fresh[:, sensor] & (reports["reasons"][:, sensor] == WELL)
        ratios = reports["ratios"][used, sensor]
        ratios = ratios[np.isfinite(ratios)]
        if len(ratios) < 2:
            yield name, None
            continue
        expected, deviation = _largest_of(count)
        half = 1.96 * deviation / np.sqrt(len(ratios))
        bounds = expected - float(half), expected + float(half)
        yield name, NisFigure(float(ratios.mean()), expected, bounds, len(ratios))


def _largest_of(count: int) -> tuple[float, float]:
    """Return mean and standard deviation of the largest of some squared normal values."""
    from scipy.special import erf

    above = 1.0 - erf(np.sqrt(_GRID / 2.0)) ** count
    mean = float(np.trapezoid(above, _GRID))
    return mean, float(np.sqrt(np.trapezoid(2.0 * _GRID * above, _GRID) - mean**2))


def _exclusions(followed: FollowedFlight) -> Iterator[Exclusion]:
    t, found = followed.samples.time_s, []
    for name, (sensor, _) in SENSORS.items():
        reasons = followed.reports["reasons"][:, sensor]
        edges = np.concatenate([[0], np.flatnonzero(np.diff(reasons)) + 1, [len(t)]])
        for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            if reasons[begin] not in {WELL, ABSENT}:
                found.append(
                    Exclusion(
                        name, REASONS[int(reasons[begin])], float(t[begin]), float(t[end - 1])
                    )
                )
    yield from sorted(found, key=lambda one: one.from_s)

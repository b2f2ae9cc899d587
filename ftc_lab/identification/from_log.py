"""Identification from a log of anybody's flight, which excites what it excites."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ftc_lab.identification.fit import CoefficientEstimate, widened
from ftc_lab.identification.identified import (
    TIME_NAMES,
    Identified,
    LogEvidence,
    finished,
    within_bounds,
)
from ftc_lab.identification.log_fit import LogModel, fit_log, predictions, smooth_of
from ftc_lab.identification.log_signals import LogSignals, log_signals
from ftc_lab.identification.segments import LogWindows, segments_of, windows_of_log
from gcs.results.logs.table import FlightTable
from sitl_plant.airframe.config import TERMS, Aircraft, Coefficients

_DIGITS = 6
_SHIFTS_S = np.arange(-0.1, 0.1501, 0.01)
_MOST = 2.0  # of an estimate, by which noise may have made it smaller
_LEAST_CORRELATION = 0.5  # of probe and motion, below which the motion says nothing of the probe
_ANGLES = {"alpha": "angle of attack", "beta": "sideslip"}


@dataclass(frozen=True)
class ProbeScale:
    """What a probe shows of a change of an angle, as a factor, between two bounds.

    Attributes:
        least: With all error in the probe.
        most: With all error in the motion.
    """

    least: float
    most: float

    @property
    def share(self) -> float:
        """By how much of itself a derivative by the angle may be wrong."""
        return max(self.most - 1.0, 1.0 - self.least, 0.0)


def identify_log(flight: FlightTable, nominal: Aircraft) -> Identified:
    """Identify an aircraft from a log.

    Args:
        flight: The log.
        nominal: The aircraft as it is known: size, mass, limits, and every coefficient that the
            flight does not show.

    Raises:
        BadInput: The log lacks something, or does not move the surfaces.
    """
    signals = log_signals(flight, nominal)
    windows = windows_of_log(signals)
    values = nominal.coefficients.model_dump()
    model = fit_log(signals, windows, values, doubted=True)
    predicted = predictions(signals, windows, values)
    scales = _probe_scales(signals, windows)
    doubled = model
    if signals.noise:
        doubled = fit_log(signals.with_noisier_probes(), windows, values, model.moments)
    estimates = {
        name: _widened(name, one, scales, doubled.fit.estimates[name])
        for name, one in model.fit.estimates.items()
    }
    changed = {
        name: within_bounds(name, float(f"{one.value:.{_DIGITS}g}"))
        for name, one in estimates.items()
    }
    coefficients = Coefficients.model_validate(values | changed)
    source = f"{nominal.source or 'nominal'}; coefficients from a flight"
    update: dict[str, object] = {"coefficients": coefficients, "source": source}
    if model.thrust is not None and not model.thrust.is_nominal and nominal.propulsion is None:
        limit = nominal.thrust_limit_n * max(model.thrust.value, 0.1)
        update["thrust_limit_n"] = float(f"{limit:.4g}")
    evidence = LogEvidence(
        segments=segments_of(signals, windows),
        shifts_s=model.shifts_s,
        predictions=predicted,
        remarks=[*signals.remarks, *_remarks(signals, windows, model, scales)],
    )
    found = model.fit._replace(estimates=estimates)
    done = finished(nominal.model_copy(update=update), found, nominal.design_airspeed, None)
    return replace(done, evidence=evidence)


def _widened(
    name: str,
    one: CoefficientEstimate,
    scales: Mapping[str, ProbeScale],
    doubled: CoefficientEstimate,
) -> CoefficientEstimate:
    """Widen an interval by what the probes may be wrong: by their scale, and by their noise.

    Noise divides an estimate by 1 + (noise over signal), and twice the noise shows by how much
    (simulation and extrapolation: Cook and Stefanski, J. Am. Stat. Assoc. 89, 1994).
    """
    if one.is_nominal:
        return one
    of = next(terms[name] for terms in TERMS.values() if name in terms)
    scale = scales.get(of.rstrip("2"))
    by_scale = 0.0 if scale is None else abs(one.value) * scale.share
    divided = one.value / doubled.value if doubled.value else math.inf  # by twice the noise
    by_noise = abs(one.value) * min(max(1.0 / max(2.0 - divided, 1e-9) - 1.0, 0.0), _MOST)
    if doubled.is_nominal:
        by_noise = 0.0
    return widened(widened(one, by_scale * (2.0 if of.endswith("2") else 1.0)), by_noise)


def _probe_scales(signals: LogSignals, windows: LogWindows) -> dict[str, ProbeScale]:
    """Compare probes of the angles with the motion that accelerations and rates make.

    Within each window, without mean and slope. Both have errors: the probe noise, the motion no
    gusts. Then regressions of one on the other and the other way round bound the factor (Klepper
    and Leamer, Econometrica 52, 1984).
    """
    if signals.kinematic is None or not np.isfinite(signals.kinematic[windows.steps]).all():
        return {}
    found = {}
    for i, name in enumerate(_ANGLES):
        turned = np.cumsum(signals.kinematic[windows.steps, i], axis=1) * signals.step_s
        motion = _bent(smooth_of(turned).reshape(len(turned), -1))
        ways = []
        for shift in _SHIFTS_S:
            angle = signals.mean(name, windows.steps, -float(shift))
            across = signals.airspeed[windows.steps] * np.sin(angle)
            probe = _bent(smooth_of(across).reshape(len(turned), -1))
            xy, xx, yy = np.sum(probe * motion), np.sum(motion**2), np.sum(probe**2)
            ways.append((xy / math.sqrt(xx * yy), xy / xx, yy / xy))
        correlation, least, most = max(ways)
        if correlation >= _LEAST_CORRELATION:
            found[name] = ProbeScale(float(least), float(most))
    return found


def _bent(rows: np.ndarray) -> np.ndarray:
    """Return rows without their mean and slope, shape (m, n)."""
    n = rows.shape[1]
    basis = np.stack([np.ones(n), np.linspace(-1.0, 1.0, n)], axis=1)
    return np.asarray(rows - rows @ np.linalg.pinv(basis).T @ basis.T)


def _remarks(
    signals: LogSignals, windows: LogWindows, model: LogModel, scales: Mapping[str, ProbeScale]
) -> Iterator[str]:
    for name, scale in scales.items():
        if scale.share > 0.1:
            yield (
                f"the {_ANGLES[name]} of the log may be {scale.least:.2g} to {scale.most:.2g} times"
                " the true one, as far as the motion shows: derivatives by it are by the log's, and"
                " their intervals have this"
            )
    for name in signals.noise:
        if name not in scales:
            yield (
                f"the motion does not show the scale of the {_ANGLES[name]}, for gusts or noise: "
                "derivatives by it are by the log's"
            )
    for one, other, correlation in model.alike:
        names = f"{TIME_NAMES.get(one, one)} and {TIME_NAMES.get(other, other)}"
        yield f"the flight hardly shows {names} apart (correlation {correlation:.2f})"
    if model.thrust is not None:
        factor = model.thrust
        yield (
            "the flight does not show the thrust: it stays the aircraft's"
            if factor.is_nominal
            else f"the thrust is {factor.value:.3g} ± {factor.half_width:.2g} times the aircraft's"
        )

"""Forces and moments from a log: least squares, output error, intervals, and their judge."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from ftc_lab.identification.fit import (
    CoefficientEstimate,
    Fit,
    Residual,
    fit_columns,
    residual_of,
    widened,
)
from ftc_lab.identification.log_signals import LogSignals
from ftc_lab.identification.moment_fit import MomentFit, fit_moments
from ftc_lab.identification.output_error import (
    MOMENT_TERMS,
    MOMENTS,
    RATE_OF,
    SHIFTS,
    MomentModel,
    rate_factor,
    rates_predicted,
    shifted,
)
from ftc_lab.identification.readings import wind_axes
from ftc_lab.identification.segments import LogWindows
from sitl_plant.airframe.config import TERMS

FORCE_AIR = {"cD": "alpha", "cL": "alpha", "cY": "beta"}
"""Forces and the angle that makes most of each; the drag, by which others are known, is first."""
THRUST = "thrust"
"""The factor of the thrust, beside the coefficients of drag."""
_SHIFTS_S = np.arange(-0.06, 0.1501, 0.01)
_SMOOTHED = 3.0 / 16.0  # of a window, three spans of travel: faster is noise of probes
_SHOTS = 4  # in a window, over which rates are simulated: four spans of travel each
_GUESSED = 80  # windows by which a fit begins
_NEAR_S = 1e-4  # to which a shift is found
_ALIKE = 0.95  # correlation of two estimates, from which on they are not shown apart

Columns = dict[str, np.ndarray]


class LogPrediction(NamedTuple):
    """How well one half of a flight predicts the other: the worse of both ways.

    Attributes:
        coefficient: R² of the coefficient, both sides averaged over three spans of travel.
        rate: R² of the rate that the moment makes, simulated over windows; None of a force.
    """

    coefficient: float
    rate: float | None = None


@dataclass(frozen=True)
class LogModel:
    """What some windows of a flight show.

    Attributes:
        moments: Coefficients of moments, and shifts.
        values: All coefficients, and the factor of the thrust.
        shifts_s: Of the air, as forces and moments answer to it, and of surfaces; empty of a
            recording of ours.
        fit: Coefficients with their intervals.
        thrust: The factor of the thrust; None: it is known, or not in the log.
        alike: Pairs of estimates that the flight hardly shows apart, with their correlation.
    """

    moments: MomentModel
    values: Mapping[str, float]
    shifts_s: Mapping[str, float]
    fit: Fit
    thrust: CoefficientEstimate | None
    alike: Sequence[tuple[str, str, float]]


def fit_log(
    signals: LogSignals,
    windows: LogWindows,
    nominal: Mapping[str, float],
    start: MomentModel | None = None,
    *,
    doubted: bool = False,
) -> LogModel:
    """Fit all that a flight shows; coefficients that it does not show stay nominal.

    Args:
        signals: The flight.
        windows: Of it.
        nominal: Coefficients as they are known.
        start: Where the fit of moments begins; None: at least squares of accelerations.
        doubted: Whether intervals have what longer windows would show.
    """
    start = start or _first_guess(signals, windows, nominal)
    solved, estimates = _moments(signals, windows, nominal, start, doubted=doubted)
    alike = _alike(solved.columns)
    residuals = {
        axis: Residual(float(solved.model.scale[i]), float(solved.share[i]))
        for i, axis in enumerate(MOMENTS)
    }
    shifts = dict(solved.model.shifts_s)
    values, thrust = {**nominal, THRUST: 1.0}, None
    steps = windows.steps
    group = np.repeat(windows.group, len(smooth_of(steps)) // len(steps))
    for axis in FORCE_AIR:
        if axis == "cD" and signals.thrust is None:
            unknown = CoefficientEstimate(0.0, math.inf, is_nominal=True)
            estimates |= {name: unknown._replace(value=nominal[name]) for name in TERMS[axis]}
            residuals[axis] = Residual(math.nan, math.nan)
            continue
        shifts[axis] = 0.0 if signals.exact else _best_shift(signals, steps, axis, shifts, values)
        columns, known, measured = force_problem(signals, steps, axis, shifts, values)
        found, left = fit_columns(columns, measured - known, group, {THRUST: 1.0, **nominal})
        alike += _alike({name: columns[name] for name, one in found.items() if not one.is_nominal})
        residuals[axis] = residual_of(left, measured)
        values |= {name: one.value for name, one in found.items()}
        thrust = found.pop(THRUST, thrust)
        estimates |= found
    ordered = {name: estimates[name] for names in TERMS.values() for name in names}
    values |= {name: one.value for name, one in ordered.items()}
    return LogModel(
        solved.model,
        values,
        {} if signals.exact else shifts,
        Fit(ordered, residuals),
        thrust,
        alike,
    )


def _moments(
    signals: LogSignals,
    windows: LogWindows,
    nominal: Mapping[str, float],
    start: MomentModel,
    *,
    doubted: bool,
) -> tuple[MomentFit, dict[str, CoefficientEstimate]]:
    """Fit moments, once more if the flight does not show some coefficients.

    A model whose form and noise were right would give the same over longer windows (Hausman,
    "Specification tests in econometrics", Econometrica 46, 1978). What it does not is part of the
    intervals.
    """
    shots = windows.parts(_SHOTS)
    solved = fit_moments(signals, shots, start, frozenset())
    known, of_all = {name: nominal[name] for name in MOMENT_TERMS}, solved.model.values
    kept = {name: one for name, one in _estimates(solved, known).items() if one.is_nominal}
    if kept:
        values = {**solved.model.values, **{name: nominal[name] for name in kept}}
        start = replace(solved.model, values=values)
        solved = fit_moments(signals, shots, start, frozenset(kept))
    found, others = _estimates(solved, {}), [of_all]
    if doubted:
        others.append(fit_moments(signals, windows, solved.model, frozenset(kept)).model.values)
    for other in others:
        found = {name: widened(one, other[name] - one.value) for name, one in found.items()}
    return solved, {**found, **kept}


def _estimates(solved: MomentFit, nominal: Mapping[str, float]) -> dict[str, CoefficientEstimate]:
    """Return estimates of moments, the problem being linear near its solution."""
    now = {**solved.model.values, **solved.model.shifts_s}
    made = sum(now[name] * column for name, column in solved.columns.items())
    found, _ = fit_columns(solved.columns, solved.left + made, solved.group, nominal)
    return {name: one for name, one in found.items() if name in MOMENT_TERMS}


def _first_guess(
    signals: LogSignals, windows: LogWindows, nominal: Mapping[str, float]
) -> MomentModel:
    """Return least squares of each moment, with the times that explain it best.

    They are the lag of the surface that moves most of it, and the shift of the air. A part of the
    windows says enough of where to begin.
    """
    steps = windows.steps[:: -(-len(windows.steps) // _GUESSED)]
    values = {name: nominal[name] for name in MOMENT_TERMS}
    shifts = dict.fromkeys(SHIFTS, 0.0)
    candidates = [0.0] if signals.exact else _SHIFTS_S[::2].tolist()
    for axis, main in (("cl", "da"), ("cm", "de"), ("cn", "dr")):
        by_air, by_lag = (
            {at: moment_problem(signals, steps, axis, {**shifts, name: at}) for at in tried}
            for name, tried in ((axis, candidates), (main, [c for c in candidates if c >= 0.0]))
        )
        best = math.inf
        for of_air, lag in product(by_air, by_lag):
            columns, measured = by_air[of_air]
            late = {name: by_lag[lag][0][name] for name, of in TERMS[axis].items() if of == main}
            columns = columns | late
            A = np.column_stack(list(columns.values()))
            found = np.linalg.lstsq(A, measured, rcond=1e-9)[0]
            size = float(np.mean((measured - A @ found) ** 2))
            if size < best:
                best, at = size, {axis: of_air, main: lag}
                values |= dict(zip(columns, found.tolist(), strict=True))
        shifts |= at
    scale = np.std(np.diff(signals.rates[steps], axis=1).reshape(-1, 3), axis=0)
    return MomentModel(values, shifts, np.maximum(scale, 1e-6))


def regressor(
    signals: LogSignals, steps: np.ndarray, axis: str, of: str, shifts_s: Mapping[str, float]
) -> np.ndarray:
    """Return what a coefficient is multiplied by, "alpha2" being a square, shape as of `steps`."""
    if of == "1":
        return np.ones(steps.shape)
    if of in RATE_OF:
        rate = signals.mean_rates[steps, RATE_OF[of][1]]
        return np.asarray(rate * rate_factor(signals, of)[steps])
    values = shifted(signals, steps, axis, of.rstrip("2"), shifts_s)
    return values**2 if of.endswith("2") else values


def _columns(
    signals: LogSignals, steps: np.ndarray, axis: str, shifts_s: Mapping[str, float]
) -> Columns:
    return {
        name: smooth_of(regressor(signals, steps, axis, of, shifts_s))
        for name, of in TERMS[axis].items()
    }


def smooth_of(values: np.ndarray) -> np.ndarray:
    """Return means over some spans of travel in windows, shapes (m, n) and (m * blocks,)."""
    each = max(round(_SMOOTHED * values.shape[1]), 1)
    blocks = values.shape[1] // each
    return np.asarray(values[:, : blocks * each].reshape(-1, each).mean(axis=1))


def force_problem(
    signals: LogSignals,
    steps: np.ndarray,
    axis: str,
    shifts_s: Mapping[str, float],
    values: Mapping[str, float],
) -> tuple[Columns, np.ndarray, np.ndarray]:
    """Return columns of a force in some windows, what is known of it, and what was measured.

    All are means over three spans of travel: noise of probes would make derivatives smaller.

    Lift and drag are in wind axes. The side force is along the body's y axis, as an accelerometer
    has it: C_Y cos β - C_D sin β, the second known by the drag.

    Args:
        signals: The flight.
        steps: Of windows, shape (m, n).
        axis: "cL", "cD" or "cY".
        shifts_s: Of surfaces, and of the air by axis.
        values: Coefficients of drag, and the factor of the thrust; of drag this is a column.
    """
    columns = _columns(signals, steps, axis, shifts_s)
    qS = signals.pressure[steps] * signals.record["S"]
    alpha, beta = (signals.mean(name, steps, shifts_s[axis]) for name in ("alpha", "beta"))
    x, y, z = np.moveaxis(signals.force[steps] * signals.record["m"] / qS[..., None], -1, 0)
    none = np.zeros(len(smooth_of(qS)))
    if axis == "cY":
        drag = _columns(signals, steps, "cD", shifts_s)
        along = sum((values[name] * column for name, column in drag.items()), none)
        return columns, -smooth_of(np.sin(beta)) * along, smooth_of(y)
    pull = np.zeros_like(qS) if signals.thrust is None else signals.thrust[steps] / qS
    if axis == "cD" and not signals.exact:
        columns[THRUST] = smooth_of(wind_axes(pull, 0.0 * y, 0.0 * z, alpha, beta)["cD"])
    else:
        x = x - values[THRUST] * pull
    return columns, none, smooth_of(wind_axes(x, y, z, alpha, beta)[axis])


def moment_problem(
    signals: LogSignals, steps: np.ndarray, axis: str, shifts_s: Mapping[str, float]
) -> tuple[Columns, np.ndarray]:
    """Return columns and coefficients of a moment, by the change of rates over steps."""
    record, i = signals.record, list(MOMENTS).index(axis)
    turning = (signals.rates[steps + 1] - signals.rates[steps]) / signals.step_s
    moment = (turning @ np.array(record["J"]) + signals.gyroscopic[steps])[..., i]
    if signals.thrust is not None:
        moment = moment - record["thrust_arms"][i] * signals.thrust[steps]
    by = signals.pressure[steps] * record["S"] * record[MOMENTS[axis]]
    return _columns(signals, steps, axis, shifts_s), smooth_of(moment / by)


def _best_shift(
    signals: LogSignals,
    steps: np.ndarray,
    axis: str,
    shifts_s: Mapping[str, float],
    values: Mapping[str, float],
) -> float:
    """Return the shift of the air with which least squares explain a force best [s]."""
    from scipy.optimize import minimize_scalar

    def left(shift: float) -> float:
        shifts = {**shifts_s, axis: shift}
        columns, known, measured = force_problem(signals, steps, axis, shifts, values)
        A, y = np.column_stack(list(columns.values())), measured - known
        return float(np.mean((y - A @ np.linalg.lstsq(A, y, rcond=1e-9)[0]) ** 2))

    first = min(_SHIFTS_S.tolist(), key=left)
    around = (first - 0.01, first + 0.01)
    return float(
        minimize_scalar(left, bounds=around, method="bounded", options={"xatol": _NEAR_S}).x
    )


def _alike(columns: Columns) -> list[tuple[str, str, float]]:
    """Return pairs of estimates whose errors go together, with their correlation."""
    A = np.column_stack(list(columns.values()))
    size = np.linalg.norm(A, axis=0)
    names, A = [n for n, s in zip(columns, size, strict=True) if s > 0.0], A[:, size > 0.0]
    covariance = np.linalg.pinv((A / size[size > 0.0]).T @ (A / size[size > 0.0]))
    deviation = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(deviation, deviation)
    return [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > _ALIKE
    ]


def predictions(
    signals: LogSignals, windows: LogWindows, nominal: Mapping[str, float]
) -> dict[str, LogPrediction]:
    """Return how well each half of the windows predicts the other, by force and moment."""
    one, other = windows.halves()
    first, second = fit_log(signals, one, nominal), fit_log(signals, other, nominal)
    ways = [_predicted(signals, other, first), _predicted(signals, one, second)]
    return {axis: min(way[axis] for way in ways) for axis in TERMS if axis in ways[0]}


def _predicted(
    signals: LogSignals, windows: LogWindows, model: LogModel
) -> dict[str, LogPrediction]:
    made, measured = rates_predicted(signals, windows, model.moments)
    steps, found = windows.steps, {}
    shifts = {**dict.fromkeys(TERMS, 0.0), **model.moments.shifts_s, **model.shifts_s}
    for axis in TERMS:
        of_rate, known = None, np.zeros(len(smooth_of(steps)))
        if axis in MOMENTS:
            i = list(MOMENTS).index(axis)
            columns, y = moment_problem(signals, steps, axis, shifts)
            of_rate = _r2(made[..., i], measured[..., i])
        elif axis == "cD" and signals.thrust is None:
            continue
        else:
            columns, known, y = force_problem(signals, steps, axis, shifts, model.values)
        by_model = sum((model.values[name] * one for name, one in columns.items()), known)
        found[axis] = LogPrediction(_r2(by_model, y), of_rate)
    return found


def _r2(made: np.ndarray, measured: np.ndarray) -> float:
    spread = float(np.sum((measured - np.mean(measured)) ** 2))
    return 1.0 - float(np.sum((measured - made) ** 2)) / spread if spread > 0.0 else math.nan

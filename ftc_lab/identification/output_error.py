"""Moments from a log by output error: rates are simulated over short windows, and fitted.

An angular acceleration is the difference of two noisy readings, and is mostly noise at 50 Hz. So it
is not formed: within each window the rates are integrated under the measured air, surfaces and
thrust, from a start that fits best (multiple shooting), and what is left of the measured rates is
made small (Jategaonkar, Flight Vehicle System Identification, 2nd ed., chapters 4 and 6). In
steps of the means of all inputs the equations are linear in the rates,

    ω̇ = J⁻¹ (q S L (C_0 + C_ω ω) - ω × Jω + thrust's moment),

so that a step is a matrix exponential, and the best start a linear least squares problem.

Each surface follows its command with the first-order lag of its servo, all of them after the delay
of a computer. Each of the three moments answers to the air at another time than the probe that
measures it, as gusts come to the tail later. So seven times are fitted with the coefficients.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ftc_lab.identification.log_signals import LogSignals
from ftc_lab.identification.segments import LogWindows
from sitl_plant.airframe.config import TERMS

MOMENTS = {"cl": "b", "cm": "c_bar", "cn": "b"}
"""Coefficients of moments, and by which length."""
RATE_OF = {"p": ("b", 0), "q": ("c_bar", 1), "r": ("b", 2)}
DELAY = "delay"
LAGS = ("da", "de", "dr")
SHIFTS = (DELAY, *LAGS, *MOMENTS)
"""Times that are fitted: the delay of all surfaces, their lags, and the air's, by moment."""
MOMENT_TERMS = {name: (axis, of) for axis in MOMENTS for name, of in TERMS[axis].items()}
_EARLIEST_S, _LATEST_S = -0.1, 0.2  # times that are looked for
_USUAL_S = 0.1  # of a shift that the log does not show: it stays within some of this
_INSIDE = 1e-3  # of the bounds, in units of a usual time, from where a fit begins
_SHIFT_STEP_S = 2e-3  # by which a derivative is taken
_ROUNDS = 2  # of weights from what is left over
_FAR = 1e6  # of what is left over, by its scale, where there is no motion
_ENOUGH = 1e-4  # change of the sum of squares, and of the parameters, by which a fit ends
_AXES = list(MOMENTS)


@dataclass(frozen=True)
class MomentModel:
    """What makes the rates.

    Attributes:
        values: Coefficients of moments by name.
        shifts_s: Times by name, as in `SHIFTS`.
        scale: What is left over of each rate, standard deviations [rad/s], shape (3,).
    """

    values: Mapping[str, float]
    shifts_s: Mapping[str, float]
    scale: np.ndarray


def rate_factor(signals: LogSignals, of: str) -> np.ndarray:
    """Return by what a rate is made nondimensional, shape (n,)."""
    if signals.record["per_rad_s"]:
        return np.ones(len(signals.airspeed))
    return np.asarray(signals.record[RATE_OF[of][0]] / (2.0 * signals.airspeed))


def times_of(axis: str, of: str) -> tuple[str, ...]:
    """Return the names of the times that an input of an axis depends on."""
    if of == "1" or of in RATE_OF:
        return ()
    return (DELAY, of) if of in LAGS else (axis,)


def shifted(signals: LogSignals, axis: str, of: str, shifts_s: Mapping[str, float]) -> np.ndarray:
    """Return a surface behind its servo, or the air as an axis answers to it, shape (n,)."""
    if of in LAGS:
        return signals.mean(of, shifts_s[DELAY], shifts_s[of])
    return signals.mean(of, shifts_s[axis])


class _Motion:
    """The equations of the rates in the steps of some windows, m of n steps."""

    def __init__(self, signals: LogSignals, windows: LogWindows) -> None:
        self.signals, self.steps = signals, windows.steps
        steps, record = windows.steps, signals.record
        self.measured = signals.rates[np.column_stack([steps, steps[:, -1] + 1])]
        qS = signals.pressure * record["S"]
        self.per = np.stack([qS * record[length] for length in MOMENTS.values()], axis=1)[steps]
        known = -signals.gyroscopic
        if signals.thrust is not None:
            known = known + np.outer(signals.thrust, record["thrust_arms"])
        self.known = known[steps]
        self.factors = {rate: rate_factor(signals, rate)[steps] for rate in RATE_OF}
        self.J_inv = np.array(record["J_inv"])
        self._inputs: dict[tuple[str, tuple[float, ...]], np.ndarray] = {}

    def _input(self, axis: str, of: str, shifts_s: Mapping[str, float]) -> np.ndarray:
        """Return what a coefficient that is none of a rate is multiplied by, shape (m, n)."""
        if of == "1":
            return np.ones(self.steps.shape)
        key = (of, tuple(shifts_s[name] for name in times_of(axis, of)))
        if key not in self._inputs:
            self._inputs[key] = shifted(self.signals, axis, of, shifts_s)[self.steps]
        return self._inputs[key]

    def _still(self, model: MomentModel) -> np.ndarray:
        """Return the coefficients of moments without the rates' part, shape (m, n, 3)."""
        found = np.zeros((*self.steps.shape, 3))
        for name, (axis, of) in MOMENT_TERMS.items():
            if of not in RATE_OF and model.values[name]:
                inputs = self._input(axis, of, model.shifts_s)
                found[..., _AXES.index(axis)] += model.values[name] * inputs
        return found

    def _transitions(self, model: MomentModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what a step makes of rates, of the inputs, and of an angular acceleration.

        Shapes (m, n, 3, 3), (m, n, 3), (m, n, 3, 3).
        """
        by_rate = np.zeros((*self.steps.shape, 3, 3))
        for name, (axis, of) in MOMENT_TERMS.items():
            if of in RATE_OF:
                factor = model.values[name] * self.factors[of]
                by_rate[..., _AXES.index(axis), RATE_OF[of][1]] += factor
        A = self.J_inv @ (by_rate * self.per[..., None])
        f = (self._still(model) * self.per + self.known) @ self.J_inv.T
        h, one = self.signals.step_s, np.broadcast_to(np.eye(3), A.shape)
        even = one + h * h / 12.0 * (A @ A)  # exp by Padé (2, 2)
        right = np.concatenate([even + h / 2.0 * A, h * f[..., None], h * one], axis=-1)
        made = np.linalg.solve(even - h / 2.0 * A, right)
        return made[..., :3], made[..., 3], made[..., 4:]

    def simulated(self, model: MomentModel) -> np.ndarray:
        """Return the rates from the measured start of each window, shape (m, n + 1, 3)."""
        transition, entry, _ = self._transitions(model)
        return _carried(self.measured[:, 0, :, None], transition, entry[..., None])[..., 0]

    def linearised(self, model: MomentModel, free: list[str]) -> tuple[np.ndarray, np.ndarray]:
        """Return what is left over with the best starts, and its derivatives by what is free.

        Both by the scale of each rate; what other starts would make is taken off the derivatives
        (variable projection, Kaufman's form). Shapes (m, n + 1, 3), (m, n + 1, 3, free).
        """
        self._inputs.clear()
        transition, entry, push = self._transitions(model)
        m, n = self.steps.shape
        of_start = np.broadcast_to(np.eye(3), (m, 3, 3))
        begin = np.concatenate([np.zeros((m, 3, 1)), of_start], axis=2)
        entries = np.concatenate([entry[..., None], np.zeros((m, n, 3, 3))], axis=3)
        made = _carried(begin, transition, entries)
        if not np.isfinite(made).all():  # coefficients with which rates grow without end
            far = np.full(self.measured.shape, _FAR)
            return far, np.zeros((*far.shape, len(free)))
        by_scale = 1.0 / model.scale[:, None]
        H = (made[..., 1:] * by_scale).reshape(m, -1, 3)
        best = np.linalg.pinv(H)
        left = ((made[..., 0] - self.measured) / model.scale).reshape(m, -1, 1)
        start = -best @ left
        rates = made[..., 0] + (made[..., 1:] @ start[:, None])[..., 0]
        pushed = push @ self._accelerations(model, free, 0.5 * (rates[:, 1:] + rates[:, :-1]))
        slopes = _carried(np.zeros((m, 3, len(free))), transition, pushed)
        slopes = (slopes * by_scale).reshape(m, -1, len(free))
        slopes = slopes - H @ (best @ slopes)
        left = left + H @ start
        return left.reshape(m, n + 1, 3), slopes.reshape(m, n + 1, 3, -1)

    def _accelerations(self, model: MomentModel, free: list[str], rates: np.ndarray) -> np.ndarray:
        """Return angular accelerations by what is free, shape (m, n, 3, free)."""
        found = np.zeros((*self.steps.shape, 3, len(free)))
        for k, name in enumerate(free):
            if name in SHIFTS:
                later = {**model.shifts_s, name: model.shifts_s[name] + _SHIFT_STEP_S}
                for term, (axis, of) in MOMENT_TERMS.items():
                    if name in times_of(axis, of) and model.values[term]:
                        now = self._input(axis, of, model.shifts_s)
                        slope = (self._input(axis, of, later) - now) / _SHIFT_STEP_S
                        found[..., _AXES.index(axis), k] += model.values[term] * slope
                continue
            axis, of = MOMENT_TERMS[name]
            if of in RATE_OF:
                value = self.factors[of] * rates[..., RATE_OF[of][1]]
            else:
                value = self._input(axis, of, model.shifts_s)
            found[..., _AXES.index(axis), k] = value
        return np.asarray(self.J_inv @ (found * self.per[..., None]))


def _carried(start: np.ndarray, transition: np.ndarray, entry: np.ndarray) -> np.ndarray:
    """Return states x⁺ = Φ x + entry from a start on, shapes (m, 3, k) and (m, n, 3, k)."""
    found = np.empty((start.shape[0], entry.shape[1] + 1, *start.shape[1:]))
    found[:, 0] = start
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(entry.shape[1]):
            found[:, k + 1] = transition[:, k] @ found[:, k] + entry[:, k]
    return found


def rates_predicted(
    signals: LogSignals, windows: LogWindows, model: MomentModel
) -> tuple[np.ndarray, np.ndarray]:
    """Return rates simulated from the measured start of each window, and those measured.

    Both without the start, shape (m, n, 3).
    """
    motion = _Motion(signals, windows)
    return motion.simulated(model)[:, 1:], motion.measured[:, 1:]


@dataclass(frozen=True)
class MomentFit:
    """The model, and its least squares problem where it is solved.

    Attributes:
        model: What fits best.
        columns: Derivatives of all rates, by their scale, by what is free, each of shape (k,).
        left: What is left over of them, shape (k,).
        group: Of each, shape (k,).
        share: Of the standard deviation of each rate that is left over, shape (3,).
    """

    model: MomentModel
    columns: dict[str, np.ndarray]
    left: np.ndarray
    group: np.ndarray
    share: np.ndarray


class _Unknowns(NamedTuple):
    """What is free, in units of its usual size, and between which bounds."""

    names: list[str]
    unit: np.ndarray
    least: np.ndarray
    most: np.ndarray

    def inside(self, x: np.ndarray) -> np.ndarray:
        """Return values a little inside of the bounds, where a fit can begin."""
        return np.asarray(np.clip(x, self.least + _INSIDE, self.most - _INSIDE))


def _unknowns(start: MomentModel, fixed: frozenset[str], *, exact: bool) -> _Unknowns:
    coefficients = [name for name in MOMENT_TERMS if name not in fixed]
    shifts = [] if exact else list(SHIFTS)
    unit = [max(abs(start.values[name]), 0.01) for name in coefficients]
    earliest = [0.0 if name in LAGS else _EARLIEST_S for name in shifts]
    endless = [math.inf] * len(coefficients)
    return _Unknowns(
        [*coefficients, *shifts],
        np.array([*unit, *(_USUAL_S for _ in shifts)]),
        np.array([*(-end for end in endless), *(at / _USUAL_S for at in earliest)]),
        np.array([*endless, *(_LATEST_S / _USUAL_S for _ in shifts)]),
    )


def fit_moments(
    signals: LogSignals, shots: LogWindows, start: MomentModel, fixed: frozenset[str]
) -> MomentFit:
    """Fit coefficients of moments and shifts to the rates of windows.

    Args:
        signals: The flight.
        shots: Windows of it over which rates are simulated.
        start: Where to begin.
        fixed: Coefficients that stay as they are; of a recording of ours all shifts do.
    """
    from scipy.optimize import least_squares

    motion, model = _Motion(signals, shots), start
    unknown = _unknowns(start, fixed, exact=signals.exact)
    free, size, unit = unknown.names, motion.measured.size, unknown.unit
    prior = np.eye(len(free))[[name in SHIFTS for name in free]]

    def model_at(x: np.ndarray) -> MomentModel:
        found = dict(zip(free, (x * unit).tolist(), strict=True))
        return MomentModel(
            {name: found.get(name, value) for name, value in start.values.items()},
            {name: found.get(name, value) for name, value in start.shifts_s.items()},
            model.scale,
        )

    solved_at: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def problem(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.tobytes() not in solved_at:
            left, slopes = motion.linearised(model_at(x), free)
            both = np.column_stack([slopes.reshape(size, -1) * unit, left.ravel()])
            last = np.column_stack([prior, prior @ x])
            few = np.asarray(np.linalg.qr(np.concatenate([both, last]), mode="r"))  # same products
            solved_at.clear()
            solved_at[x.tobytes()] = few[:, -1], few[:, :-1]
        return solved_at[x.tobytes()]

    x = unknown.inside(np.array([{**start.values, **start.shifts_s}[name] for name in free]) / unit)
    for _ in range(_ROUNDS):
        solved = least_squares(
            lambda x: problem(x)[0],
            x,
            lambda x: problem(x)[1],
            bounds=(unknown.least, unknown.most),
            ftol=_ENOUGH,
            xtol=_ENOUGH,
        )
        solved_at.clear()
        x = unknown.inside(solved.x)
        rest = motion.linearised(model_at(solved.x), free)[0].reshape(-1, 3) * model.scale
        model = replace(model_at(x), scale=np.sqrt(np.mean(rest**2, axis=0)))
    left, slopes = motion.linearised(model, free)
    columns = dict(zip(free, slopes.reshape(size, -1).T, strict=True))
    spread = np.std(motion.measured.reshape(-1, 3), axis=0)
    group = np.repeat(shots.group, size // len(shots.group))
    return MomentFit(model, columns, -left.ravel(), group, model.scale / spread)

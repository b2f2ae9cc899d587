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

from collections.abc import Mapping
from dataclasses import dataclass
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
_SHIFT_STEP_S = 2e-3  # by which a derivative is taken
_FAR = 1e6  # of what is left over, by its scale, where there is no motion
_AXES = list(MOMENTS)
GROUPS = ([0, 2], [1])  # of axes, whose rates depend on each other


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


def shifted(
    signals: LogSignals, steps: np.ndarray, axis: str, of: str, shifts_s: Mapping[str, float]
) -> np.ndarray:
    """Return a surface behind its servo, or the air as an axis answers to it, in some steps."""
    if of in LAGS:
        return signals.mean(of, steps, shifts_s[DELAY], shifts_s[of])
    return signals.mean(of, steps, shifts_s[axis])


class Linearised(NamedTuple):
    """What is left over of a group of rates in m windows, and its derivatives.

    Attributes:
        names: By which, k of them.
        left: By the scale of each rate, shape (n + 1, d, m).
        slopes: Shape (n + 1, d, k, m).
    """

    names: list[str]
    left: np.ndarray
    slopes: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        """The derivatives and, as the last column, what is left over; shape (., k + 1)."""
        both = np.concatenate([self.slopes, self.left[:, :, None]], axis=2)
        return both.swapaxes(2, 3).reshape(-1, len(self.names) + 1)


class RateMotion:
    """The equations of the rates in the steps of some windows, m of n steps.

    An aircraft is alike to both sides, so that rolling and yawing go together, and pitching alone:
    two groups, of d = 2 rates and 1, of which each has derivatives by what is its own. The windows
    are the last axis of all arrays here, as the same step of all of them is taken at once.
    """

    def __init__(self, signals: LogSignals, windows: LogWindows) -> None:
        self.signals, self.steps = signals, windows.steps
        steps, record = windows.steps, signals.record
        self.measured = signals.rates[np.column_stack([steps, steps[:, -1] + 1])].T
        qS = signals.pressure[steps].T * record["S"]
        self.per = np.stack([qS * record[length] for length in MOMENTS.values()])
        known = -signals.gyroscopic[steps]
        if signals.thrust is not None:
            known = known + signals.thrust[steps][..., None] * record["thrust_arms"]
        self.known = known.T
        self.factors = {rate: rate_factor(signals, rate)[steps].T for rate in RATE_OF}
        self.J_inv = np.array(record["J_inv"])
        self._inputs: dict[tuple[str, tuple[float, ...]], np.ndarray] = {}

    def _input(self, axis: str, of: str, shifts_s: Mapping[str, float]) -> np.ndarray:
        """Return what a coefficient that is none of a rate is multiplied by, shape (n, m)."""
        if of == "1":
            return np.ones(self.steps.T.shape)
        key = (of, tuple(shifts_s[name] for name in times_of(axis, of)))
        if key not in self._inputs:
            found = shifted(self.signals, self.steps, axis, of, shifts_s)
            self._inputs[key] = np.ascontiguousarray(found.T)
        return self._inputs[key]

    def _transitions(
        self, model: MomentModel, axes: list[int]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what a step makes of rates, of all inputs, and of coefficients of moments.

        Shapes (d, d, n, m), (d, n, m), (d, d, n, m).
        """
        d, h, per = len(axes), self.signals.step_s, self.per[axes]
        by_rate, still = np.zeros((d, d, *per.shape[1:])), np.zeros(per.shape)
        for name, axis, i, of in _terms_of(axes):
            value = model.values[name]
            if of in RATE_OF:
                by_rate[i, axes.index(RATE_OF[of][1])] += value * self.factors[of]
            elif value:
                still[i] += value * self._input(axis, of, model.shifts_s)
        J_inv, one = self.J_inv[np.ix_(axes, axes)], np.eye(d)[..., None, None]
        A = h * _times(J_inv, by_rate * per[:, None])
        push = h * _inverse(one - A / 2.0 + _times(A, A) / 12.0)  # exp by Padé (2, 2)
        inputs = _times(J_inv, (still * per + self.known[axes])[:, None])
        return one + _times(push, A) / h, _times(push, inputs)[:, 0], _times(push, J_inv) * per

    def simulated(self, model: MomentModel) -> np.ndarray:
        """Return the rates from the measured start of each window, shape (3, n + 1, m)."""
        found = np.empty(self.measured.shape)
        for axes in GROUPS:
            transition, entry, _ = self._transitions(model, axes)
            made = _carried(self.measured[axes, None, 0], transition, entry[:, None])
            found[axes] = made[:, :, 0].swapaxes(0, 1)
        return found

    def linearised(self, model: MomentModel, free: list[str]) -> list[Linearised]:
        """Return what is left over with the best starts, and its derivatives by what is free.

        Both by the scale of each rate; what other starts would make is taken off the derivatives
        (variable projection, Kaufman's form). For each group of rates.
        """
        self._inputs.clear()
        return [self._linearised(model, free, axes) for axes in GROUPS]

    def _linearised(self, model: MomentModel, free: list[str], axes: list[int]) -> Linearised:
        terms = _terms_of(axes)
        own = {name for term, axis, _, of in terms for name in (term, *times_of(axis, of))}
        names = [name for name in free if name in own]
        transition, entry, push = self._transitions(model, axes)
        d, n, m = entry.shape
        begin, entries = np.zeros((d, 1 + d, m)), np.zeros((d, 1 + d, n, m))
        begin[:, 1:], entries[:, 0] = np.eye(d)[..., None], entry
        made = _carried(begin, transition, entries)
        if not np.isfinite(made).all():  # coefficients with which rates grow without end
            far = np.full((n + 1, d, m), _FAR)
            return Linearised(names, far, np.zeros((n + 1, d, len(names), m)))
        scale = model.scale[axes][:, None]
        left = (made[:, :, 0] - self.measured[axes].swapaxes(0, 1)) / scale
        H = made[:, :, 1:] / scale[..., None]
        best = np.einsum("abm,nibm->anim", _inverse(np.einsum("niam,nibm->abm", H, H)), H)
        start = -np.einsum("anim,nim->am", best, left)
        rates = made[:, :, 0] + np.einsum("niam,am->nim", made[:, :, 1:], start)
        pushed = _times(push, self._moments(model, names, axes, 0.5 * (rates[1:] + rates[:-1])))
        slopes = _carried(np.zeros((d, len(names), m)), transition, pushed) / scale[..., None]
        by_start = np.einsum("anim,nikm->akm", best, slopes)
        slopes -= np.einsum("niam,akm->nikm", H, by_start)
        return Linearised(names, left + np.einsum("niam,am->nim", H, start), slopes)

    def _moments(
        self, model: MomentModel, names: list[str], axes: list[int], rates: np.ndarray
    ) -> np.ndarray:
        """Return coefficients of moments by what is free, shape (d, k, n, m)."""
        found = np.zeros((len(axes), len(names), *self.steps.T.shape))
        for name, axis, i, of in _terms_of(axes):
            now = None if of in RATE_OF else self._input(axis, of, model.shifts_s)
            if name in names:
                by = self.factors[of] * rates[:, axes.index(RATE_OF[of][1])] if now is None else now
                found[i, names.index(name)] = by
            for one in times_of(axis, of):
                if one in names and now is not None:
                    later = {**model.shifts_s, one: model.shifts_s[one] + _SHIFT_STEP_S}
                    slope = (self._input(axis, of, later) - now) / _SHIFT_STEP_S
                    found[i, names.index(one)] += model.values[name] * slope
        return found


def _terms_of(axes: list[int]) -> list[tuple[str, str, int, str]]:
    """Return coefficients of some moments: name, axis, place of the axis, what it belongs to."""
    return [
        (name, axis, axes.index(_AXES.index(axis)), of)
        for name, (axis, of) in MOMENT_TERMS.items()
        if _AXES.index(axis) in axes
    ]


def _times(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return products of matrices that are the first two axes."""
    return np.asarray(np.einsum("ij...,jk...->ik...", one, other))


def _inverse(one: np.ndarray) -> np.ndarray:
    """Return inverses of matrices of 1 x 1 or 2 x 2 that are the first two axes."""
    if len(one) == 1:
        return np.asarray(1.0 / one)
    (a, b), (c, d) = one
    return np.asarray(np.array([[d, -b], [-c, a]]) / (a * d - b * c))


def _carried(start: np.ndarray, transition: np.ndarray, entry: np.ndarray) -> np.ndarray:
    """Return states x⁺ = Φ x + entry from a start on.

    Shapes (n + 1, d, k, m) of (d, k, m), (d, d, n, m), (d, k, n, m).
    """
    found = np.empty((entry.shape[2] + 1, *start.shape))
    found[0] = start
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(entry.shape[2]):
            found[k + 1] = _times(transition[:, :, k], found[k]) + entry[:, :, k]
    return found


def rates_predicted(
    signals: LogSignals, windows: LogWindows, model: MomentModel
) -> tuple[np.ndarray, np.ndarray]:
    """Return rates simulated from the measured start of each window, and those measured.

    Both without the start, shape (m, n, 3).
    """
    motion = RateMotion(signals, windows)
    return motion.simulated(model)[:, 1:].T, motion.measured[:, 1:].T

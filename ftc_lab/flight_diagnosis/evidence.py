"""Evidence, at each time of a flight, that a relation does not hold any more.

The relation is learnt from the flight itself, up to 10 s before the time that is judged, so that a
fault is not learnt before it is found: recursive least squares with forgetting, samples far off
counting less (Huber's weights), and a prior that all coefficients are small. A generalised
likelihood ratio (Willsky and Jones, IEEE TAC 21, 1976) then asks of windows that end now whether
their residuals have another mean, or the response another gain. Its square root, as of twice its
logarithm, is the evidence: in standard deviations, if the residuals were white. They are not, so
their size is measured over means of 2 s; and where the relation was never seen, its coefficients'
own uncertainty counts.

What a healthy flight reaches is another matter, and known from other flights (`decisions`).
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_lab.flight_diagnosis.relations import LearningPace, Relation

_MEMORY_S = 90.0  # after which a sample counts 1/e
_PRIOR_S = 2.0  # of samples that the prior counts as
_CORRELATED_S = 1.0  # of samples count as one, of the coefficients' uncertainty
_FEW = 10.0  # blocks: of so few the variance is taken to be twice as large
_HUBER, _CLIP = 2.0, 3.0  # in sizes of residuals: samples further off count less, or no further
_BASE_S = 20.0  # before a window, which that is compared with
_LEAST_WINDOW = 3  # samples
_LIKELY = 1.92  # less than the largest logarithm of a likelihood ratio: half of the 95 % of chi²
_TINY = 1e-12


class Residuals(NamedTuple):
    """What is left of a relation, as each sample was predicted 10 s before.

    Attributes:
        residual: Measured minus predicted, shape (n,); 0 where nothing is judged.
        weight: One over its variance; 0 where nothing is judged.
        predicted: Shape (n,).
        response: What a gain is tested of, shape (n,).
    """

    residual: np.ndarray
    weight: np.ndarray
    predicted: np.ndarray
    response: np.ndarray


def residuals_of(relation: Relation) -> Residuals:
    """Learn a relation along a flight and predict it."""
    valid = np.isfinite(relation.measured) & np.isfinite(relation.terms).all(axis=1)
    X = np.where(valid[:, None], _standardised(relation.terms, valid), 0.0)
    y = np.where(valid, relation.measured, 0.0)
    n, m = X.shape
    pace, predicted, weight = relation.pace, np.zeros(n), np.zeros(n)
    model, guard = _Model(m, pace, relation.least), pace.steps(pace.guard_s)
    for i in range(n):
        if i >= guard and valid[i - guard]:
            model.learn(X[i - guard], y[i - guard])
        if valid[i] and model.measured >= pace.steps(pace.least_measured_s):
            predicted[i] = X[i] @ model.coefficients
            weight[i] = 1.0 / (model.variance() * model.stretch(X[i]))
    response = predicted
    if relation.response is not None:
        response = np.where(weight > 0.0, relation.response, 0.0)
    return Residuals(np.where(weight > 0.0, y - predicted, 0.0), weight, predicted, response)


def _standardised(terms: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return terms with a mean of 0 and a variance of 1, but for the first, which is constant."""
    if not valid.any():
        return terms
    mean, deviation = terms[valid].mean(axis=0), terms[valid].std(axis=0)
    mean[0], deviation[0] = 0.0, 1.0
    return np.asarray((terms - mean) / (deviation + _TINY))


class _Model:
    """Recursive least squares, and the size of their residuals."""

    def __init__(self, terms: int, pace: LearningPace, least: float) -> None:
        self.coefficients = np.zeros(terms)
        self.measured = 0  # residuals
        prior = np.append(1.0, np.full(terms - 1, pace.steps(_PRIOR_S)))
        self._A, self._b = np.diag(prior), np.zeros(terms)
        self._P: np.ndarray = np.diag(1.0 / prior)
        self._forget = 1.0 - 1.0 / pace.steps(_MEMORY_S)
        self._least = least
        self._correlated = pace.steps(_CORRELATED_S)
        self._not_learnt = pace.steps(pace.least_learnt_s)
        self._weights = self._squares = self._block_squares = 0.0
        self._block = np.zeros(pace.steps(pace.block_s))

    def stretch(self, x: np.ndarray) -> float:
        """Return by what the coefficients' uncertainty makes the variance of a residual larger."""
        return float(1.0 + self._correlated * x @ self._P @ x)

    def variance(self) -> float:
        """Return the variance of a residual, as large as means of blocks show it."""
        length = len(self._block)
        few = 1.0 + _FEW * length / self._weights
        return (self._block_squares / self._weights * few + self._least**2) * length + _TINY

    def learn(self, x: np.ndarray, y: float) -> None:
        """Measure the residual of a sample, then learn it."""
        residual = float(y - x @ self.coefficients) / math.sqrt(self.stretch(x))
        self._block[:-1] = self._block[1:]
        self._block[-1] = residual
        self._not_learnt -= 1
        weight = 1.0 if self._not_learnt >= 0 else self._measure(residual)
        self._A = self._forget * self._A + weight * (x[:, None] * x)
        self._b = self._forget * self._b + weight * y * x
        self._P = np.linalg.inv(self._A)
        self.coefficients = self._P @ self._b

    def _measure(self, residual: float) -> float:
        """Note a residual; return the weight of its sample."""
        weight = 1.0
        size = block_size = float("inf")
        if self.measured >= len(self._block):
            size = math.sqrt(self._squares / self._weights)
            block_size = math.sqrt(self._block_squares / self._weights)
            weight = min(1.0, _HUBER * size / max(abs(residual), _TINY))
        squares = min(abs(residual), _CLIP * size) ** 2
        mean = float(np.add.reduce(self._block)) / len(self._block)
        block_squares = min(abs(mean), _CLIP * block_size) ** 2
        self._squares = self._forget * self._squares + squares
        self._block_squares = self._forget * self._block_squares + block_squares
        self._weights = self._forget * self._weights + 1.0
        self.measured += 1
        return weight


def evidence_of(relation: Relation, residuals: Residuals) -> np.ndarray:
    """Return the evidence against a relation at each time, shape (n,)."""
    best = np.zeros(len(residuals.residual))
    for window_s in relation.pace.windows_s[relation.test]:
        found = _window(relation, residuals, relation.pace.steps(window_s))
        best = np.maximum(best, found)
    return best


class Onset(NamedTuple):
    """The samples with which a fault begins: most likely, and 95 % of the likelihood."""

    likely: int
    earliest: int
    latest: int


def onset_of(relation: Relation, residuals: Residuals, begin: int, end: int) -> Onset:
    """Return where the most likely window begins that ends at `end`.

    Args:
        relation: The relation.
        residuals: Of it.
        begin: First sample that may be it.
        end: Last sample of the window, later than `begin`.
    """
    cut = Residuals(*(values[: end + 1] for values in residuals))
    lengths = np.arange(_LEAST_WINDOW, end - begin + 2)
    likely = np.array([_window(relation, cut, steps)[-1] ** 2 for steps in lengths.tolist()]) / 2.0
    starts = end + 1 - lengths
    near = starts[likely >= likely.max() - _LIKELY]
    return Onset(int(starts[np.argmax(likely)]), int(near.min()), int(near.max()))


def _window(relation: Relation, residuals: Residuals, steps: int) -> np.ndarray:
    if relation.test == "response":
        return _response(residuals, steps)
    base = relation.pace.steps(_BASE_S)
    return _shift(residuals, steps, base, down=relation.test == "drop")


def _response(residuals: Residuals, steps: int) -> np.ndarray:
    """Return the evidence for another mean together with a smaller gain in a window."""
    e, w, x = residuals.residual, residuals.weight, residuals.response
    sums = [_last(values, steps) for values in (w, w * e, w * x, w * x * e, w * x * x)]
    count, Se, Sx, Sxe, Sxx = sums
    count = count + _TINY
    covariance, variance = Sxe - Se * Sx / count, Sxx - Sx * Sx / count + _TINY
    return np.asarray(np.sqrt(Se**2 / count + np.maximum(-covariance, 0.0) ** 2 / variance))


def _shift(residuals: Residuals, steps: int, base: int, *, down: bool) -> np.ndarray:
    """Return the evidence for another mean in a window: than 0, and than before it; the less."""
    count, total = _last(residuals.weight, steps) + _TINY, _last(_weighted(residuals), steps)
    count0 = _last(residuals.weight, base, steps) + _TINY
    total0 = _last(_weighted(residuals), base, steps)
    from_zero = total / np.sqrt(count)
    from_before = (total / count - total0 / count0) / np.sqrt(1.0 / count + 1.0 / count0)
    least = np.minimum(np.abs(from_zero), np.abs(from_before))
    agree = from_zero * from_before > 0.0
    if down:
        agree &= from_zero < 0.0
    return np.where(agree, least, 0.0)


def _weighted(residuals: Residuals) -> np.ndarray:
    return np.asarray(residuals.weight * residuals.residual)


def _last(values: np.ndarray, steps: int, ago: int = 0) -> np.ndarray:
    """Return the sum over some samples that ended so many ago, of each sample, shape (n,)."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    end = np.arange(1, len(values) + 1) - ago
    return np.asarray(sums[np.clip(end, 0, None)] - sums[np.clip(end - steps, 0, None)])

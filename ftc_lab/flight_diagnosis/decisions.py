"""What the evidence of a flight says: whether something failed, which, when, how sure.

The largest evidence that a healthy flight reaches differs from surface to surface. It is known from
other flights, as two numbers of a Gumbel distribution, which maxima have; a threshold is what one
healthy flight in so many exceeds. A flight whose own evidence has been large all along, as in gusts
that the others had not, is doubted: its thresholds are up to twice as high. What fails first is
named by the evidence within 2 s after the alarm, relative to the thresholds: later, much follows
from it.
"""

from bisect import insort
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np
import yaml
from pydantic import BaseModel

from ftc_lab.flight_diagnosis.evidence import Residuals, evidence_of, onset_of, residuals_of
from ftc_lab.flight_diagnosis.relations import LearningPace, Relation, Relations, Surface

FALSE_ALARMS = 0.02
"""Share of healthy flights that thresholds let alarm."""
LEARNT = "learnt.yaml"
"""What was learnt from other flights, beside this module."""
_OWN_S = 20.0  # of evidence that a flight must have had of its own, to be doubted by it
_OWN_SHARE, _OWN_TIMES, _MOST_DOUBT = 0.9, 2.5, 2.0  # an alarm is so many times what 90 % are below
_LONGEST_S = 15.0  # before an alarm, in which a fault may have begun


class Gumbel(BaseModel, frozen=True, extra="forbid"):
    """Distribution of the largest evidence of a healthy flight."""

    location: float
    scale: float

    def exceeded_by(self, share: float) -> float:
        """Return what a share of the flights exceeds."""
        return self.location - self.scale * float(np.log(-np.log1p(-share)))


class Learnt(BaseModel, frozen=True, extra="forbid"):
    """What other flights have shown.

    Attributes:
        healthy: The largest evidence of a healthy flight, by surface.
        judged_s: How long such a flight was judged [s]: a longer one has more to be the largest of.
        fault: Logistic regression of whether there is a fault on the logarithm of the largest
            ratio of evidence to threshold: intercept and slope.
        naming: By what ratios are multiplied to be logarithms of the surfaces' odds.
        flights: How many were looked at: so few show no probability of 99 %.
        faults: How many of them were found to fail, and named.
    """

    healthy: Mapping[Surface, Gumbel]
    judged_s: float
    fault: tuple[float, float]
    naming: float
    flights: int
    faults: int

    def threshold(self, surface: Surface, judged_s: float) -> float:
        """Return the evidence that is an alarm in a flight that is judged for so long."""
        longer = max(judged_s / self.judged_s, 1.0)
        return self.healthy[surface].exceeded_by(FALSE_ALARMS / len(self.healthy) / longer)

    def probability(self, ratio: float) -> float:
        """Return how probable a fault is, given the largest ratio of evidence to threshold."""
        intercept, slope = self.fault
        fitted = float(1.0 / (1.0 + np.exp(-(intercept + slope * np.log(max(ratio, 1e-3))))))
        return _shown(fitted, self.flights, 2)

    def chances(self, ratios: Mapping[Surface, float]) -> dict[Surface, float]:
        """Return how probable each surface is, given that one has failed."""
        most = max(ratios.values())
        weights = {s: float(np.exp(self.naming * (one - most))) for s, one in ratios.items()}
        total = sum(weights.values())
        return {one: _shown(w / total, self.faults, len(ratios)) for one, w in weights.items()}


def _shown(probability: float, cases: int, outcomes: int) -> float:
    """Return a probability as so many cases can show it: Laplace's rule of succession."""
    return (cases * probability + 1.0) / (cases + outcomes)


def learnt(relations: Relations) -> Learnt:
    """Return what the file beside this module has for relations of their kind."""
    text = files(__package__).joinpath(LEARNT).read_text(encoding="utf-8")
    return Learnt.model_validate(yaml.safe_load(text)[relations.pace.kind]["learnt"])


class Finding(NamedTuple):
    """What failed.

    Attributes:
        surface: The most probable.
        alarm_s: Until when the log has to be read to find it [s].
        onset_s: Since when, most likely [s].
        between_s: From when to when that may be, by 95 % of the likelihood [s].
        ratios: The largest evidence of each within 2 s, relative to its threshold.
        probabilities: Of each surface, given that one of these has failed.
    """

    surface: Surface
    alarm_s: float
    onset_s: float
    between_s: tuple[float, float]
    ratios: dict[Surface, float]
    probabilities: dict[Surface, float]


@dataclass(frozen=True)
class Diagnosis:
    """What was found in a flight.

    Attributes:
        time_s: The grid, shape (n,).
        ratios: Evidence as of `ratios_of`, each of shape (n,); 1 is an alarm.
        finding: None if nothing was found.
        probability: That there is a fault.
        cannot: What could not be judged, and why.
    """

    time_s: np.ndarray
    ratios: Mapping[Surface, np.ndarray]
    finding: Finding | None
    probability: float
    cannot: tuple[str, ...]


class Watched(NamedTuple):
    """A relation along a flight; the evidence against it has shape (n,)."""

    relation: Relation
    residuals: Residuals
    evidence: np.ndarray

    @property
    def judged_s(self) -> float:
        """How long it was judged: not while it was learnt [s]."""
        return np.count_nonzero(self.residuals.weight) / self.relation.pace.rate_hz


def watch(relations: Relations) -> dict[Surface, Watched]:
    """Learn the relations of a flight along it, and test each of which enough is learnt."""
    found = {one.surface: (one, residuals_of(one)) for one in relations.relations}
    return {
        surface: Watched(*both, evidence_of(*both))
        for surface, both in found.items()
        if both[1].weight.any()
    }


def ratios_of(watched: Mapping[Surface, Watched], known: Learnt) -> dict[Surface, np.ndarray]:
    """Return the evidence relative to the thresholds, in doubt by the flight's own."""
    found = {}
    for surface, one in watched.items():
        ratio, pace = one.evidence / known.threshold(surface, one.judged_s), one.relation.pace
        judged = one.residuals.weight > 0.0
        usual = _usual_before(ratio, judged, pace.steps(pace.guard_s), pace.steps(_OWN_S))
        found[surface] = ratio / np.clip(_OWN_TIMES * usual, 1.0, _MOST_DOUBT)
    return found


def _usual_before(ratio: np.ndarray, judged: np.ndarray, guard: int, least: int) -> np.ndarray:
    """Return what 90 % of earlier values are below, of each sample; 0 before there are enough."""
    found, past = np.zeros(len(ratio)), list[float]()
    for i in range(guard, len(ratio)):
        if judged[i - guard]:
            insort(past, float(ratio[i - guard]))
        if len(past) >= least:
            found[i] = past[int(_OWN_SHARE * len(past))]
    return found


def diagnose_flight(
    relations: Relations, watched: Mapping[Surface, Watched], known: Learnt
) -> Diagnosis:
    """Judge a flight, of which something is watched, by what others have shown."""
    ratios = ratios_of(watched, known)
    first, pace = first_alarm(ratios), relations.pace
    finding = None
    if first is not None:
        finding = _finding(relations.time_s, watched, ratios, first, pace, known)
    most = max(float(one.max()) for one in ratios.values())
    unseen = (one.surface for one in relations.relations if one.surface not in watched)
    short = (f"{surface} not judged: too little to learn what is healthy" for surface in unseen)
    cannot = (*relations.cannot, *short)
    return Diagnosis(relations.time_s, ratios, finding, known.probability(most), cannot)


def _finding(
    time_s: np.ndarray,
    watched: Mapping[Surface, Watched],
    ratios: Mapping[Surface, np.ndarray],
    first: int,
    pace: LearningPace,
    known: Learnt,
) -> Finding:
    """Return what failed, given the sample of the alarm."""
    surface, largest = named(ratios, first, pace.steps(pace.named_s))
    end = min(first + pace.steps(pace.named_s / 2.0), len(time_s) - 1)
    onset = onset_of(*watched[surface][:2], max(first - pace.steps(_LONGEST_S), 0), end)
    since = np.maximum(time_s[list(onset)] - pace.lag_s, time_s[0]).tolist()
    return Finding(
        surface,
        float(time_s[first]),
        since[0],
        (since[1], since[2]),
        largest,
        known.chances(largest),
    )


def first_alarm(ratios: Mapping[Surface, np.ndarray]) -> int | None:
    """Return the first sample at which evidence is above its threshold; None if it never is."""
    above = np.max(list(ratios.values()), axis=0) > 1.0
    return int(np.argmax(above)) if above.any() else None


def named(
    ratios: Mapping[Surface, np.ndarray], first: int, steps: int
) -> tuple[Surface, dict[Surface, float]]:
    """Return the surface of most evidence soon after an alarm, and the largest ratio of each."""
    largest = {
        surface: float(one[first : first + steps + 1].max()) for surface, one in ratios.items()
    }
    return max(largest, key=lambda surface: largest[surface]), largest

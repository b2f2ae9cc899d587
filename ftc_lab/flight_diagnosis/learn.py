"""Learn from flights of which is known what failed, and judge each by what the others show.

    .venv/bin/python -m ftc_lab.flight_diagnosis.learn FOLDER
    .venv/bin/python -m ftc_lab.flight_diagnosis.learn --simulated 48

The folder has one table for each flight of the AirLab Failure and Anomaly data set (ALFA: Keipour,
Mousaei and Scherer, IJRR 40, 2021; theairlab.org/alfa-dataset, CC BY 4.0), as they are in the
folder `failures` of github.com/FabioCarosi/FaultDetection_ALFA-Dataset, packed or not. Their names
say what failed, the column `field.data` when. `learnt.yaml` was learnt from the flights that it
lists, and from no others. The second line flies so many flights of our own, for what is judged by
a model of the aircraft.
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from ftc_lab.flight_diagnosis.decisions import LEARNT, Gumbel, Learnt, diagnose_flight
from ftc_lab.flight_diagnosis.examples import Example, example_of
from ftc_lab.flight_diagnosis.relations import SURFACES, Surface
from ftc_lab.flight_diagnosis.simulated import simulated_examples
from gcs.console.lines import print_line

_LEAST = 0.5  # times the usual healthy time: flights with less count not, as they are hardly judged
_PRIOR = 3.0  # standard deviation of coefficients: few flights do not make anything certain
_PARTS = 24  # of the flights: each is judged by what the others show
_LARGEST = 20.0  # coefficient of the names that is tried
_HEADER = """\
# Written by: python -m ftc_lab.flight_diagnosis.learn
# telemetry: from flights of the AirLab Failure and Anomaly data set (CMU, CC BY 4.0,
# theairlab.org/alfa-dataset); model: from flights of our own.
# healthy: Gumbel distribution of the largest evidence of a healthy flight; the others: see Learnt.
"""


def learnt_from(examples: list[Example]) -> Learnt:
    """Fit what is to be known of healthy flights and of faults."""
    healthy = {surface: _gumbel(examples, surface) for surface in SURFACES}
    judged_s = float(np.median([next(iter(one.watched.values())).judged_s for one in examples]))
    known = Learnt(
        healthy=healthy,
        judged_s=judged_s,
        fault=(0.0, 1.0),
        naming=1.0,
        flights=len(examples),
        faults=0,
    )
    ratios, faulty, names = [], [], []
    for one in examples:
        for before in (True, False) if one.truth else (True,):
            ratios.append(one.ratio(known, healthy=before))
            faulty.append(not before)
        found = diagnose_flight(one.relations, one.watched, known).finding
        if found is not None and found.alarm_s >= one.onset_s:
            names.append((one.truth, found.ratios))
    intercept, slope = _logistic(np.log(np.maximum(ratios, 1e-3)), np.array(faulty))
    fitted = {"fault": (intercept, slope), "naming": _sharpness(names), "faults": len(names)}
    return known.model_copy(update=fitted)


def _gumbel(examples: list[Example], surface: Surface) -> Gumbel:
    """Fit quartiles: a flight that was not as healthy as it is said to be counts no more."""
    healthy_s = [min(one.onset_s, one.relations.time_s[-1]) for one in examples]
    least_s = _LEAST * np.median(healthy_s)
    enough = [one for one, time_s in zip(examples, healthy_s, strict=True) if time_s >= least_s]
    largest = [one.largest(surface, healthy=True) for one in enough if surface in one.watched]
    low, median, high = np.percentile(largest, (25.0, 50.0, 75.0))
    scale = (high - low) / (np.log(np.log(4.0)) - np.log(np.log(4.0 / 3.0)))
    return Gumbel(location=float(median + scale * np.log(np.log(2.0))), scale=float(scale))


def _logistic(x: np.ndarray, is_true: np.ndarray) -> tuple[float, float]:
    """Fit intercept and slope by Newton's method, with a normal prior of both."""
    X, beta = np.stack([np.ones_like(x), x], axis=1), np.zeros(2)
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-X @ beta))
        gradient = X.T @ (is_true - p) - beta / _PRIOR**2
        hessian = (X * (p * (1.0 - p))[:, None]).T @ X + np.eye(2) / _PRIOR**2
        beta = beta + np.linalg.solve(hessian, gradient)
    return float(beta[0]), float(beta[1])


def _sharpness(names: list[tuple[Surface | None, dict[Surface, float]]]) -> float:
    """Return the factor of the ratios that makes the true names most likely."""
    factors = np.linspace(0.0, _LARGEST, 401)
    likely = -0.5 * (factors / _PRIOR) ** 2
    for truth, at in names:
        if truth is not None:
            more = np.array(list(at.values())) - at[truth]
            likely -= np.logaddexp.reduce(factors[:, None] * more, axis=1)
    return float(factors[np.argmax(likely)])


class JudgedFlight(NamedTuple):
    """How a flight is judged by what the others show; delays are of alarm and onset [s]."""

    name: str
    verdict: str
    probability: float
    alarm_delay_s: float
    onset_delay_s: float


def judge(one: Example, known: Learnt) -> JudgedFlight:
    """Judge a flight by what is learnt from others."""
    diagnosis = diagnose_flight(one.relations, one.watched, known)
    found = diagnosis.finding
    if found is None:
        verdict = "missed" if one.truth else "quiet"
        return JudgedFlight(one.name, verdict, diagnosis.probability, np.nan, np.nan)
    if found.alarm_s < one.onset_s:
        verdict = f"false alarm: {found.surface}"
    else:
        verdict = "named" if found.surface == one.truth else f"misnamed: {found.surface}"
    delays = found.alarm_s - one.onset_s, found.onset_s - one.onset_s
    return JudgedFlight(one.name, verdict, diagnosis.probability, *delays)


def main() -> None:
    """Judge each of some flights by the others, print how, and write what all have shown."""
    if len(sys.argv) not in {2, 3}:
        raise SystemExit(__doc__)
    if sys.argv[1] == "--simulated":
        examples = list(simulated_examples(int(sys.argv[2]), seed=1))
        flights = [" ".join(sys.argv[1:])]
    else:
        examples = [example_of(path) for path in sorted(Path(sys.argv[1]).glob("*.csv*"))]
        flights = [one.name.split(".")[0] for one in examples]
    if len(examples) < 2:
        raise SystemExit(f"error: {sys.argv[1]} has no flights (*.csv, *.csv.xz)")
    for part in np.array_split(np.arange(len(examples)), min(len(examples), _PARTS)):
        known = learnt_from([one for k, one in enumerate(examples) if k not in part])
        for found in (judge(examples[k], known) for k in part):
            print_line(
                f"{found.verdict:24} {found.probability:5.2f} {found.alarm_delay_s:7.1f} "
                f"{found.onset_delay_s:6.1f}  {found.name}"
            )
    path = Path(__file__).with_name(LEARNT)
    content = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else {}
    exact = learnt_from(examples).model_dump_json()
    shown = json.loads(exact, parse_float=lambda number: float(f"{float(number):.4g}"))
    content[examples[0].relations.pace.kind] = {"learnt": shown, "flights": flights}
    text = _HEADER + yaml.safe_dump(content, sort_keys=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

"""Figures of a campaign's report: which flights count, which were worst, which factors matter."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ftc_autopilot.plugins.loading import without_code
from ftc_lab.campaigns.conditions import severity
from ftc_lab.campaigns.draws import dimensions
from ftc_lab.campaigns.factors import title_of, unit_of
from ftc_lab.campaigns.importance import Importance, SobolIndex, importances, sobol_indices
from ftc_lab.campaigns.mark import Mark, mark_of
from ftc_lab.campaigns.samples import Sample, read_samples
from ftc_lab.campaigns.stopping import leading
from ftc_lab.campaigns.store import planned_rows
from ftc_lab.campaigns.until import noted_conditions
from gcs.results.quantities import IAE_UNITS, QUANTITIES
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.config.models import ConfigError

FIGURES = {
    **{f"iae_{name}": f"IAE of {name} [{IAE_UNITS[name]}]" for name in QUANTITIES},
    "events": "events of all UAVs",
}
"""Figures that reports compare, with their names; an IAE is the worst UAV's."""

_IAES = tuple(f"iae_{name}" for name in QUANTITIES)


@dataclass(frozen=True)
class Worst:
    """One of the worst flights of a campaign."""

    row: int
    variant: str
    draw: int
    outcome: str
    reason: str
    tracking_error: float


@dataclass(frozen=True)
class Findings:
    """The content of a report.

    Attributes:
        folder: Folder of the campaign, as the user named it.
        mark: What was flown, and by which code.
        planned: Number of planned flights.
        ended: Every flight that ended, by variant.
        until: Conditions that may have stopped the campaign early, as users write them.
    """

    folder: Path
    mark: Mark
    planned: int
    ended: Mapping[str, Sample]
    until: Sequence[str] = ()

    @cached_property
    def counted(self) -> dict[str, Sample]:
        """Sample that statistics count: each variant's up to the first draw that is missing.

        Whatever ended first is no fair sample, because lost flights are short.
        """
        return {name: own.take(leading(own.draw)) for name, own in self.ended.items()}

    @property
    def is_sample(self) -> bool:
        """Whether draws are spread as distributions say, each for itself.

        Points of a grid come from no distribution, points of a Saltelli design share coordinates.
        """
        return self.mark.campaign.design not in {"grid", "saltelli"}

    @property
    def anytime(self) -> bool:
        """Whether results so far could decide how many flights there are."""
        return bool(self.until or self.mark.extended_from)

    @property
    def codes(self) -> list[tuple[str, str]]:
        """Versions and digests of the code that flew."""
        pairs = (
            zip(own.texts("version"), own.texts("digest"), strict=True)
            for own in self.ended.values()
        )
        return sorted(set(itertools.chain.from_iterable(pairs)))

    @cached_property
    def _scales(self) -> dict[str, float]:
        """Median of each IAE over all flights that succeeded."""
        found = {}
        for name in _IAES:
            costs = np.concatenate([own.cost(name) for own in self.counted.values()])
            known = costs[np.isfinite(costs)]
            found[name] = (float(np.median(known)) if len(known) else 0.0) or 1.0
        return found

    def tracking_error(self, flights: Sample) -> np.ndarray:
        """Return the mean of a flight's four IAEs, each relative to its median over all flights.

        Returns:
            Shape (flights,); infinite for failures, 1 for a flight that is all medians.
        """
        parts = [flights.cost(name) / scale for name, scale in self._scales.items()]
        return np.asarray(np.mean(parts, axis=0))

    def importances(self, variant: str) -> dict[str, list[Importance]]:
        """Return the factors' importances for failure and for tracking error, by what it is."""
        return self._importances[variant]

    @cached_property
    def _importances(self) -> dict[str, dict[str, list[Importance]]]:
        found = {}
        for variant, flights in self.counted.items():
            failure = (~flights.success).astype(float)
            costs = {"failure": failure, "tracking error": self.tracking_error(flights)}
            found[variant] = importances(flights.factors(), costs)
        return found

    def most_important_pair(self) -> tuple[str, str] | None:
        """Return the two numeric factors that matter most, of those that some flight has together.

        By the average of all variants, for failure where any flight failed, or else for the
        tracking error. What few flights have counts less, as its share of the ranks' deviation.
        """
        found = [self.importances(name) for name in self.counted]
        what = "failure" if any(each["failure"] for each in found) else "tracking error"
        total: dict[str, float] = {}
        for each, flights in zip(found, self.counted.values(), strict=True):
            for factor in each[what]:
                if factor.correlation is not None and self._known(factor.factor).any():
                    share = (factor.flights / len(flights)) ** 0.5
                    total[factor.factor] = total.get(factor.factor, 0.0) + share * factor.strength
        first, *others = sorted(total, key=lambda name: -total[name]) or [""]
        for other in others:
            if (self._known(first) & self._known(other)).any():
                return first, other
        return None

    def _known(self, factor: str) -> np.ndarray:
        """Return which flights of all variants have a factor that can be drawn."""
        drawn = np.concatenate([own.factor(factor) for own in self.counted.values()])
        return np.asarray(np.isfinite(drawn))

    def title(self, factor: str) -> str:
        """Return a factor's name with its unit, as reports show it."""
        own = self.mark.campaign.factors.get(factor.removeprefix("factor."))
        if own is None:
            return title_of(factor)
        if own.relative:
            return title_of(factor, "× nominal")
        key = own.key or factor.removeprefix("factor.")
        return title_of(factor, unit_of(self._base, key) if self._base else "")

    @cached_property
    def _base(self) -> Scenario | None:
        """The base scenario; None if it is none without the values that are drawn."""
        try:
            with without_code():
                return scenario_of(self.mark.file, self.mark.scenario)
        except ConfigError:
            return None

    def sobol(self, variant: str) -> dict[str, list[SobolIndex]]:
        """Return Sobol indices by cost: of failure, and of the tracking error if none failed.

        None for other than Saltelli designs, unfinished ones, and costs that do not vary.
        """
        campaign, sample = self.mark.campaign, self.counted[variant]
        if campaign.design != "saltelli":
            return {}
        names = [axis.column for axis in dimensions(campaign, self.mark.uav_ids)]
        if len(sample) != (campaign.draws or 0) * (len(names) + 2):
            return {}
        failure = (~sample.success).astype(float)
        costs = {"failure": failure, "tracking error": self.tracking_error(sample)}
        return {
            what: sobol_indices(names, cost)
            for what, cost in costs.items()
            if np.isfinite(cost).all() and np.ptp(cost) > 0.0
        }

    def worst(self, count: int) -> list[Worst]:
        """Return the worst flights: by outcome, then the soonest end, then the tracking error."""
        found = []
        for flights in self.ended.values():
            error = self.tracking_error(flights)
            bad = severity(flights.outcome)
            duration_s = np.nan_to_num(flights.numbers("duration_s"))
            ended_s = np.where(flights.success, np.inf, duration_s)
            order = np.lexsort((flights.row, -np.nan_to_num(error), ended_s, -bad))[:count]
            reasons = flights.take(order).texts("reason")
            found += [
                (
                    (-bad[i], ended_s[i], -error[i], flights.row[i]),
                    Worst(
                        int(flights.row[i]),
                        flights.variant,
                        int(flights.draw[i]),
                        str(flights.outcome[i]),
                        reason or "",
                        float(error[i]),
                    ),
                )
                for i, reason in zip(order, reasons, strict=True)
            ]
        return [each for _, each in sorted(found, key=lambda pair: pair[0])[:count]]


def findings_of(folder: Path) -> Findings:
    """Read a campaign.

    Raises:
        BadInput: It is none, or it cannot be read.
    """
    mark = mark_of(folder)
    samples = read_samples(folder)
    return Findings(folder, mark, planned_rows(folder), samples, noted_conditions(folder))

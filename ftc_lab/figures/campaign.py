"""Figures of a campaign: distributions, importance of factors, flights over two factors."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_lab.campaigns.findings import FIGURES, Findings
from ftc_lab.campaigns.importance import Importance, SobolIndex
from gcs.reports.figures import style
from gcs.reports.figures.flown import literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAX_STEPS = 1000  # of a curve
_MAX_POINTS = 4000  # of a panel
_MAX_FACTORS = 12
_FAILED = {"marker": "x", "color": "#D55E00", "s": 26.0, "linewidths": 1.2, "zorder": 3.0}


def distributions(findings: Findings) -> "Figure":
    """Draw the empirical distribution of every figure, a curve for each variant.

    A failure has no figure and lies beyond every value: curves end at the share that succeeded.
    """
    figure = style.new_figure(6.0)
    panels = figure.subplots(2, 3, sharey=True).flat
    for panel, (name, title) in zip(panels, FIGURES.items(), strict=False):
        costs = {variant: own.cost(name) for variant, own in findings.counted.items()}
        _draw_distributions(panel, costs)
        panel.set_xlabel(title)
        panel.set_ylabel("share of all flights")
    panels[-1].set_visible(False)
    style.draw_legend(figure)
    return figure


def _draw_distributions(panel: "Axes", costs: Mapping[str, np.ndarray]) -> None:
    known = np.concatenate([own[np.isfinite(own)] for own in costs.values()])
    if not len(known):
        style.note(panel, "no flight succeeded")
    style.logarithmic_if_wide(panel, known)
    for i, (variant, own) in enumerate(costs.items()):
        values = np.sort(own[np.isfinite(own)])
        if not len(values):
            panel.plot([], [], label=literal(f"{variant} (none succeeded)"), **style.style(i).line)
            continue
        shares = np.arange(1, len(values) + 1) / len(own)
        if len(values) > _MAX_STEPS:
            kept = np.unique(np.linspace(0, len(values) - 1, _MAX_STEPS).astype(int))
            values, shares = values[kept], shares[kept]
        x, y = np.append(values, known.max()), np.append(shares, shares[-1])
        panel.step(
            np.insert(x, 0, values[0]),
            np.insert(y, 0, 0.0),
            where="post",
            label=literal(variant),
            **style.style(i).line,
        )
    panel.set_ylim(0.0, 1.03)
    style.tidy(panel)


def importance(findings: Findings) -> "Figure":
    """Draw the strength of each factor's association, for failure and for the tracking error."""
    found = {variant: findings.importances(variant) for variant in findings.counted}
    names = _strongest([each for own in found.values() for each in own.values()])
    bars = len(names) * len(found)
    figure = style.new_figure(max(2.6, 1.2 + 0.11 * bars + 0.12 * len(names)))
    panels = figure.subplots(1, 2, sharey=True)
    for panel, what in zip(panels, ("failure", "tracking error"), strict=True):
        _draw_bars(panel, names, {variant: own[what] for variant, own in found.items()})
        panel.set_xlabel(f"strength of the association with {what}")
    _name_factors(panels, [findings.title(name) for name in names])
    style.draw_legend(figure)
    return figure


def _name_factors(panels: Sequence["Axes"], titles: Sequence[str]) -> None:
    """Give every factor a row, and name it beside the first panel."""
    panels[0].set_yticks(range(len(titles)), list(map(literal, titles)))
    panels[0].set_ylim(len(titles) - 0.4, -0.6)
    for panel in panels[1:]:
        panel.tick_params(labelleft=False)


def _strongest(lists: Sequence[Sequence[Importance]]) -> list[str]:
    strength: dict[str, float] = {}
    for found in lists:
        for each in found:
            strength[each.factor] = max(strength.get(each.factor, 0.0), each.strength)
    return sorted(strength, key=lambda name: -strength[name])[:_MAX_FACTORS]


def _draw_bars(
    panel: "Axes", names: Sequence[str], found: Mapping[str, Sequence[Importance]]
) -> None:
    """Draw the bars of all variants; solid where the association is significant."""
    height = 0.8 / max(len(found), 1)
    for i, (variant, own) in enumerate(found.items()):
        by_name = {each.factor: each for each in own}
        level = 0.05 / max(len(own), 1)
        colour = style.style(i).colour
        panel.plot([], [], color=colour, lw=6.0, label=literal(variant))
        for k, name in enumerate(names):
            if (each := by_name.get(name)) is None:
                continue
            at = k - 0.4 + (i + 0.5) * height
            fill = {"color": colour} if each.p_value <= level else {
                "facecolor": "none", "edgecolor": colour, "linewidth": 0.8,
            }  # fmt: skip
            panel.barh(at, each.strength, 0.85 * height, **fill)
            if each.correlation is not None and each.strength >= 0.005:  # a bar that can be seen
                sign = "+" if each.correlation > 0.0 else "−"
                panel.text(
                    each.strength + 0.01, at, sign, va="center", size=style.SMALL, color=style.GREY
                )
    if not any(found.values()):
        style.note(panel, "all flights alike")
    panel.set_xlim(0.0, 1.0)
    style.tidy(panel)
    panel.grid(visible=False, axis="y")


def sobol_indices(findings: Findings) -> "Figure | None":
    """Draw total and first-order Sobol indices of each factor, with their 95 % intervals.

    Returns:
        The figure, a panel for each cost; None if the design or the flights permit no indices.
    """
    found = {variant: findings.sobol(variant) for variant in findings.counted}
    costs = list(dict.fromkeys(cost for own in found.values() for cost in own))
    if not costs:
        return None
    totals: dict[str, float] = {}
    for each in (each for own in found.values() for listed in own.values() for each in listed):
        totals[each.factor] = max(totals.get(each.factor, 0.0), each.total)
    names = sorted(totals, key=lambda name: -totals[name])[:_MAX_FACTORS]
    figure = style.new_figure(max(2.6, 1.2 + 0.2 * len(names) * len(found)))
    panels = figure.subplots(1, len(costs), sharey=True, squeeze=False)[0]
    for panel, cost in zip(panels, costs, strict=True):
        _draw_indices(panel, names, {variant: own.get(cost, []) for variant, own in found.items()})
        panel.set_xlabel(f"share of the variance of {cost}")
    _name_factors(panels, [findings.title(name) for name in names])
    style.draw_legend(figure)
    return figure


def _draw_indices(
    panel: "Axes", names: Sequence[str], found: Mapping[str, Sequence[SobolIndex]]
) -> None:
    """Draw the indices of all variants: a bar for the total, a dot for the first order."""
    height = 0.8 / max(len(found), 1)
    for i, (variant, own) in enumerate(found.items()):
        colour = style.style(i).colour
        panel.plot([], [], color=colour, lw=6.0, label=literal(variant))
        for each in (each for each in own if each.factor in names):
            at = names.index(each.factor) - 0.4 + (i + 0.5) * height
            panel.barh(at, each.total, 0.85 * height, color=colour, alpha=0.5)
            error: dict[str, Any] = {"color": style.GREY, "lw": 0.8, "capsize": 2.0}
            panel.errorbar(each.total, at + 0.2 * height, xerr=each.total_half_width, **error)
            dot = {**error, "fmt": "o", "ms": 3.5, "mfc": colour, "mec": style.GREY}
            panel.errorbar(each.first, at - 0.2 * height, xerr=each.first_half_width, **dot)
    panel.set_xlim(min(0.0, panel.get_xlim()[0]), max(1.0, panel.get_xlim()[1]))
    style.tidy(panel)
    panel.grid(visible=False, axis="y")


def two_factors(findings: Findings) -> "Figure | None":
    """Draw the flights over the two most important numeric factors, failures as crosses.

    Returns:
        The figure, a panel for each variant; None if there are fewer than two such factors.
    """
    names = findings.most_important_pair()
    if names is None:
        return None
    variants = findings.counted
    columns = min(len(variants), 3)
    rows = math.ceil(len(variants) / columns)
    figure = style.new_figure(0.6 + 3.1 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for panel in panels.flat[len(variants) :]:
        panel.set_visible(False)
    for panel, flights in zip(panels.flat, variants.values(), strict=False):
        x, y = (flights.factor(name) for name in names)
        known, failed = np.isfinite(x) & np.isfinite(y), ~flights.success
        shown = _sample(np.flatnonzero(known & ~failed)), _sample(np.flatnonzero(known & failed))
        good: dict[str, Any] = {"s": 9.0, "color": style.SINGLE, "alpha": 0.6, "lw": 0.0}
        panel.scatter(x[shown[0]], y[shown[0]], label="succeeded", **good)
        panel.scatter(x[shown[1]], y[shown[1]], label="failed", **_FAILED)
        panel.set_title(literal(flights.variant), loc="left", size=style.SMALL + 1.0)
        counts = f"{failed[known].sum()} of {known.sum()} failed"
        style.note(panel, f"{counts}{_left_out(shown, known.sum())}")
        style.tidy(panel)
        panel.set_xlabel(literal(findings.title(names[0])))
        panel.set_ylabel(literal(findings.title(names[1])))
    style.draw_legend(figure)
    return figure


def _sample(indices: np.ndarray) -> np.ndarray:
    """Return evenly spaced ones of too many flights: draws have no order."""
    kept = np.linspace(0, len(indices) - 1, min(len(indices), _MAX_POINTS)).astype(int)
    return np.asarray(indices[kept])


def _left_out(shown: Sequence[np.ndarray], flights: int) -> str:
    left = flights - sum(map(len, shown))
    return f", {left} not drawn" if left else ""

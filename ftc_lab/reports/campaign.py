"""The report of a campaign, in Markdown."""

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ftc_lab.campaigns.conditions import parse_condition
from ftc_lab.campaigns.findings import FIGURES, Findings
from ftc_lab.campaigns.importance import Importance
from ftc_lab.campaigns.statistics import flights_needed, proportion, quantile, tolerance_bound
from ftc_lab.campaigns.stopping import anytime_proportion, judge
from ftc_lab.campaigns.store import OUTCOMES
from ftc_lab.figures.campaign import distributions, importance, sobol_indices, two_factors
from ftc_lab.reports.campaign_comparisons import comparisons
from ftc_lab.reports.campaign_laws import hint, same_flights
from ftc_lab.reports.laws import law_markdown
from ftc_lab.reports.markdown import (
    html_of,
    interval,
    number,
    plain,
    probability,
    render,
    save_markdown,
)
from gcs.reports.figures.style import save
from mavlink_defs.config.output_files import write_text

_CAPTIONS = {
    "distributions": "Share of all flights at or below a value. Failures lie beyond every value: "
    "each curve ends at the share that succeeded.",
    "importance": "Strength of the association of factors with failure and with the tracking "
    "error; filled bars are significant (5 %, Bonferroni), + and − show the direction.",
    "sobol": "Sobol indices: bars are total indices, dots first-order ones, with 95 % intervals.",
    "two_factors": "Every flight that has both of the two most important numeric factors.",
}
_WORST = 10
_FACTORS = 8


def write_report(findings: Findings) -> Path:
    """Write the report of a campaign into its folder, of the flights that have ended so far.

    Returns:
        The path of report.html, which needs no other file.

    Raises:
        OSError: A file cannot be written; it is named.
    """
    folder, figures = findings.folder, {}
    drawings = {
        "distributions": distributions,
        "importance": importance,
        "sobol": sobol_indices,
        "two_factors": two_factors,
    }
    for name, draw in drawings.items() if any(findings.counted.values()) else ():
        if (figure := draw(findings)) is not None:
            save(figure, folder / "figures", name)
            figures[name] = _CAPTIONS[name]
    markdown = campaign_report(findings, figures)
    save_markdown(folder / "report.md", markdown)
    write_text(folder / "report.html", html_of(markdown, folder))
    return folder / "report.html"


def campaign_report(findings: Findings, figures: Mapping[str, str]) -> str:
    """Return the whole report.

    Args:
        findings: What it is about.
        figures: Caption of each figure in `figures/`, by its file's name without suffix.
    """
    campaign = findings.mark.campaign
    return render(
        "campaign.md",
        findings=findings,
        figures=figures,
        campaign=campaign,
        design=campaign.design.replace("_", " "),
        ended=sum(map(len, findings.ended.values())),
        counted=sum(map(len, findings.counted.values())),
        codes=[f"version {version}, digest `{digest}`" for version, digest in findings.codes],
        success=_success(findings),
        flights_needed=flights_needed(),
        stopping=list(_stopping(findings)),
        quantiles=list(_quantiles(findings)),
        comparisons=comparisons(findings) if len(findings.counted) > 1 else None,
        laws=list(_laws(findings)),
        add_simpler=plain(hint(findings)),
        factors=_factors(findings),
        sobol=list(_sobol(findings)),
        worst=list(_worst(findings)),
    )


def _success(findings: Findings) -> dict[str, list[Any]]:
    """Return head and rows of the table of outcomes."""
    invalid = any("invalid" in flights.outcome for flights in findings.counted.values())
    outcomes = OUTCOMES if invalid else OUTCOMES[: OUTCOMES.index("invalid")]
    estimate = anytime_proportion if findings.anytime else proportion
    rows = []
    for name, flights in findings.counted.items():
        counts, n = Counter(flights.outcome.tolist()), len(flights)
        good = int(flights.success.sum())
        limits = [probability(good / max(n, 1)), "-"]
        if findings.is_sample:
            sure = estimate(good, n, 0.90).low
            limits = [interval(estimate(good, n), "probability"), probability(sure)]
        rows.append([f"`{name}`", n, *(counts[each] for each in outcomes), *limits])
    named = (each.replace("_", " ") for each in outcomes)
    head = ["variant", "flights", *named, "success [95 % interval]", "at least, at 95 %"]
    return {"head": head, "rows": rows}


def _stopping(findings: Findings) -> Iterator[list[Any]]:
    """Yield the verdict on each condition that may have stopped the campaign, by variant."""
    for text in findings.until:
        condition = parse_condition(text, "--until")
        for name, sample in findings.counted.items():
            found = judge(condition, sample.outcome)
            yield [f"`{text}`", f"`{name}`", found.count, found.flights, found.decided]


def _quantiles(findings: Findings) -> Iterator[list[Any]]:
    for figure, title in FIGURES.items():
        for name, flights in findings.counted.items():
            costs = flights.cost(figure)
            median = quantile(costs, 0.5)
            cells = [number(median.value), "-"]
            if findings.is_sample:
                cells = [interval(median), number(tolerance_bound(costs))]
            yield [title, f"`{name}`", *cells, int(np.isinf(costs).sum())]


def _laws(findings: Findings) -> Iterator[str]:
    """Yield a table of each group of variants that fly the same by several laws."""
    for group in same_flights(findings):
        columns = {f"`{name}`": law for name, law in group.laws.items()}
        rows = [
            row._replace(cells={f"`{name}`": cell for name, cell in row.cells.items()})
            for row in group.rows
        ]
        yield law_markdown([f"of {group.draws} draws"], rows, columns)


def _factors(findings: Findings) -> dict[str, list[Any]]:
    """Return head and rows of the table of the strongest factors."""
    rows = []
    for name in findings.counted:
        for what, found in findings.importances(name).items():
            level = 0.05 / max(len(found), 1) if findings.is_sample else 1.0
            strong = [each for each in found if each.p_value <= level][:_FACTORS]
            listed = ", ".join(_strength(findings, each, name) for each in strong)
            rows.append([f"`{name}`", what, len(found), listed or "none"])
    which = "significant, the" if findings.is_sample else "no test: the"
    return {"head": ["variant", "cost", "factors", f"{which} strongest first"], "rows": rows}


def _strength(findings: Findings, found: Importance, variant: str) -> str:
    value = found.strength if found.correlation is None else found.correlation
    sign = "" if found.correlation is None else "+"
    part = found.flights < len(findings.counted[variant])
    flights = f" (of {found.flights} flights)" if part else ""
    return f"{plain(findings.title(found.factor))} {value:{sign}.2f}{flights}"


def _sobol(findings: Findings) -> Iterator[list[str]]:
    """Yield the Sobol indices; none if the design has none."""
    for name in findings.counted:
        for what, found in findings.sobol(name).items():
            for each in found[:_FACTORS]:
                yield [
                    plain(findings.title(each.factor)),
                    f"`{name}`",
                    what,
                    f"{each.first:.2f} ± {each.first_half_width:.2f}",
                    f"{each.total:.2f} ± {each.total_half_width:.2f}",
                ]


def _worst(findings: Findings) -> Iterator[list[Any]]:
    folder = shlex.quote(str(findings.folder))
    for each in findings.worst(_WORST):
        yield [
            f"`gcs fly --campaign {folder} --row {each.row}`",
            f"`{each.variant}`",
            each.draw,
            each.outcome.replace("_", " "),
            number(each.tracking_error),
            plain(each.reason),
        ]

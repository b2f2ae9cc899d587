"""The report of a campaign, in Markdown."""

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gcs.figures.style import save
from gcs.lab.campaigns.conditions import parse_condition
from gcs.lab.campaigns.findings import FIGURES, Findings, findings_of
from gcs.lab.campaigns.importance import Importance
from gcs.lab.campaigns.statistics import flights_needed, proportion, quantile, tolerance_bound
from gcs.lab.campaigns.stopping import anytime_proportion, judge
from gcs.lab.campaigns.store import OUTCOMES
from gcs.lab.figures.campaign import distributions, importance, sobol_indices, two_factors
from gcs.lab.reports.campaign_comparisons import comparisons
from gcs.lab.reports.markdown import (
    bullets,
    html_of,
    interval,
    number,
    plain,
    probability,
    save_markdown,
    table,
)
from mavlink_defs.runtime.files import write_text

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


def write_report(folder: Path) -> Path:
    """Write the report of a campaign into its folder, of the flights that have ended so far.

    Returns:
        The path of report.html, which needs no other file.

    Raises:
        BadInput: The folder is not that of a campaign, or cannot be read.
        OSError: A file cannot be written; it is named.
    """
    findings = findings_of(folder)
    figures = {}
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

    def shown(name: str) -> str:
        if name not in figures:
            return ""
        return f"\n![{name}](figures/{name}.png)\n\n*{figures[name]}*\n"

    parts = [
        f"# Campaign {plain(findings.mark.campaign.name)}\n",
        _introduction(findings),
        "## Success\n",
        _success(findings) + _stopping(findings),
        "## Tracking and events\n",
        _quantiles(findings) + shown("distributions"),
        *(["## Variants on the same draws\n", comparisons(findings)] if _several(findings) else []),
        "## Factors that matter\n",
        _factors(findings) + shown("importance") + shown("sobol") + shown("two_factors"),
        "## The worst flights\n",
        _worst(findings),
        "## What these numbers assume\n",
        bullets(_assumptions(findings)),
    ]
    return "\n".join(parts)


def _several(findings: Findings) -> bool:
    return len(findings.counted) > 1


def _introduction(findings: Findings) -> str:
    mark = findings.mark
    campaign = mark.campaign
    ended = sum(map(len, findings.ended.values()))
    counted = sum(map(len, findings.counted.values()))
    text = f"{plain(campaign.description)}\n\n" if campaign.description else ""
    text += (
        f"Scenario `{campaign.scenario}`; {ended} of {findings.planned} planned flights have "
        f"ended, by {len(findings.ended)} of {len(campaign.variants)} variants; design "
        f"{campaign.design.replace('_', ' ')}, seed {campaign.seed}. "
    )
    codes = [f"version {version}, digest `{digest}`" for version, digest in findings.codes]
    text += f"Code: {'; '.join(codes) or 'none yet'}.\n"
    if len(codes) > 1:
        text += "\n**The flights were flown by different code.**\n"
    if ended < findings.planned:
        text += f"\n**{findings.planned - ended} planned flights have not been flown.**\n"
    if mark.extended_from:
        before = ", then ".join(map(str, mark.extended_from))
        text += (
            f"\nThe campaign had {before} draws before more were added, perhaps because of its "
            "results. Probabilities below allow for that; medians, bounds, comparisons and factors "
            "are computed as if the number of flights had been fixed beforehand.\n"
        )
    if counted < ended:
        text += (
            f"\nStatistics leave out {ended - counted} flights that ended before an earlier draw "
            "of their variant did: lost flights are short, and whatever ends first is no fair "
            "sample.\n"
        )
    return text


def _success(findings: Findings) -> str:
    anytime = findings.anytime
    invalid = any("invalid" in flights.outcome for flights in findings.counted.values())
    outcomes = OUTCOMES if invalid else OUTCOMES[: OUTCOMES.index("invalid")]
    estimate = anytime_proportion if anytime else proportion
    rows = []
    for name, flights in findings.counted.items():
        counts, n = Counter(flights.outcome.tolist()), len(flights)
        good = int(flights.success.sum())
        sure = estimate(good, n, 0.90).low
        found = interval(estimate(good, n), "probability")
        limits = (
            [found, probability(sure)]
            if findings.is_sample
            else [probability(good / max(n, 1)), "-"]
        )
        rows.append([f"`{name}`", n, *(counts[each] for each in outcomes), *limits])
    head = [
        "variant",
        "flights",
        *(each.replace("_", " ") for each in outcomes),
        "success [95 % interval]",
        "at least, at 95 %",
    ]
    text = table(head, rows) + (
        "\nA flight succeeded if it was flown to its end and every UAV kept attitude and heading "
        "within 90° of the reference. Every other outcome is a failure, also a crashed process "
        "and a flight that could not be computed; none is left out. Each variant's flights count "
        "up to its first draw that has not been flown"
        + (", here and in the verdicts below. " if findings.until else ". ")
    )
    if not findings.is_sample:
        return text + (
            f"**These are points of a {findings.mark.campaign.design} design and not independent "
            "draws: shares are of its points, not probabilities, and have no intervals.**\n"
        )
    text += (
        "Intervals are those of a confidence sequence, which hold although results could decide "
        "how many flights there are. "
        if anytime
        else "Intervals are Clopper and Pearson's, two-sided. "
    )
    return text + (
        "The last column is the lower limit of a one-sided interval: with 95 % confidence at least "
        "this share of all flights succeeds. "
        + ("" if anytime else f"{flights_needed()} flights without a failure show 95 %. ")
        + "Each interval is valid by itself, not all of them together.\n"
    )


def _stopping(findings: Findings) -> str:
    """Return a table of the conditions that may have stopped the campaign; empty without one."""
    rows = []
    for text in findings.until:
        condition = parse_condition(text, "--until")
        for name, sample in findings.counted.items():
            found = judge(condition, sample.outcome)
            rows.append([f"`{text}`", f"`{name}`", found.count, found.flights, found.decided])
    if not rows:
        return ""
    return (
        "\n"
        + table(["condition", "variant", "events", "flights", "verdict"], rows)
        + "\nShown: the condition holds with the stated confidence; refuted: its contrary does; "
        "open: neither. Each is wrong at most as often as stated, however often the results were "
        "looked at. Medians, bounds, comparisons and factors below are computed as if the number "
        "of flights had been fixed beforehand: after a stop they are approximate.\n"
    )


def _quantiles(findings: Findings) -> str:
    rows = []
    for figure, title in FIGURES.items():
        for name, flights in findings.counted.items():
            costs = flights.cost(figure)
            median = quantile(costs, 0.5)
            if findings.is_sample:
                cells = [interval(median), number(tolerance_bound(costs))]
            else:
                cells = [number(median.value), "-"]
            missing = int(np.isinf(costs).sum())
            rows.append([title, f"`{name}`", *cells, missing])
    head = [
        "figure",
        "variant",
        "median [95 % interval]",
        "95 % of flights below",
        "without figure",
    ]
    return table(head, rows) + (
        "\nAn IAE is the integral of the absolute error against the commands, of the worst UAV. "
        "All flights count: those without a figure (last column: failures, and flights in which no "
        "step had an error) lie above every figure. Intervals are between order statistics and "
        "assume no distribution; the bound holds with 95 % confidence. A dash: too few flights or "
        "too many failures.\n"
    )


def _factors(findings: Findings) -> str:
    rows = []
    for name in findings.counted:
        for what, found in findings.importances(name).items():
            level = 0.05 / max(len(found), 1) if findings.is_sample else 1.0
            strong = [each for each in found if each.p_value <= level][:_FACTORS]
            listed = ", ".join(_strength(findings, each, name) for each in strong)
            rows.append([f"`{name}`", what, len(found), listed or "none"])
    which = "significant, the" if findings.is_sample else "no test: the"
    head = ["variant", "cost", "factors", f"{which} strongest first"]
    return (
        table(head, rows)
        + _sobol(findings)
        + "\nSpearman's rank correlation of a factor with failure (0 or 1), or with the tracking "
        "error: the mean of the four IAEs, each relative to its median over all flights, "
        "failures ranked worst. A factor without an order has the correlation ratio of the "
        "ranks, without a sign (Kruskal and Wallis's test). A severity counts by its size, among "
        "the flights with that kind of fault alone: severities of unlike faults are not "
        "comparable. Significant: at 5 % after "
        "Bonferroni's correction for the number of factors. Rank correlation sees monotonic "
        "effects only: a factor that harms at both ends may be missing here.\n"
    )


def _strength(findings: Findings, found: Importance, variant: str) -> str:
    value = found.strength if found.correlation is None else found.correlation
    sign = "" if found.correlation is None else "+"
    part = found.flights < len(findings.counted[variant])
    flights = f" (of {found.flights} flights)" if part else ""
    return f"{plain(findings.title(found.factor))} {value:{sign}.2f}{flights}"


def _sobol(findings: Findings) -> str:
    """Return a table of Sobol indices; empty if the design has none."""
    rows = [
        [
            plain(findings.title(each.factor)),
            f"`{name}`",
            what,
            f"{each.first:.2f} ± {each.first_half_width:.2f}",
            f"{each.total:.2f} ± {each.total_half_width:.2f}",
        ]
        for name in findings.counted
        for what, found in findings.sobol(name).items()
        for each in found[:_FACTORS]
    ]
    if not rows:
        return ""
    head = ["factor", "variant", "cost", "first-order index", "total index"]
    return (
        "\n" + table(head, rows) + "\nSobol indices: shares of the cost's variance that go with a "
        "factor on its own, and with all its interactions; ± half of the 95 % bootstrap interval. "
        "Where a flight failed the tracking error has no variance, and only failure has indices.\n"
    )


def _worst(findings: Findings) -> str:
    folder = shlex.quote(str(findings.folder))
    rows = [
        [
            f"`gcs fly --campaign {folder} --row {each.row}`",
            f"`{each.variant}`",
            each.draw,
            each.outcome.replace("_", " "),
            number(each.tracking_error),
            plain(each.reason),
        ]
        for each in findings.worst(_WORST)
    ]
    head = ["flies it again", "variant", "draw", "outcome", "tracking error", "reason"]
    return table(head, rows) + (
        "\nBy outcome, then by the earlier end, then by the tracking error (1: all IAEs are "
        "median).\n"
    )


def _assumptions(findings: Findings) -> Iterator[str]:
    yield (
        "The numbers are about the simulated aircraft and the distributions of the campaign file, "
        "not about an aircraft that flies."
    )
    if findings.mark.campaign.design in {"latin_hypercube", "sobol"}:
        yield (
            "Intervals and tests are derived for independent draws. Points of a "
            f"{findings.mark.campaign.design.replace('_', ' ')} design are spread more evenly than "
            "those, so the intervals are usually wider than needed; this is no theorem."
        )
    yield "docs/explanation/campaign-statistics.md has the methods with their sources and limits."

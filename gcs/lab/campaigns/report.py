"""The report of a campaign: report.md, report.html and figures in its folder."""

from pathlib import Path

from gcs.figures.style import save
from gcs.lab.campaigns.findings import findings_of
from gcs.lab.figures.campaign import distributions, importance, sobol_indices, two_factors
from gcs.lab.reports.campaign import campaign_report
from gcs.lab.reports.markdown import html_of, save_markdown
from mavlink_defs.runtime.files import write_text

_CAPTIONS = {
    "distributions": "Share of all flights at or below a value. Failures lie beyond every value: "
    "each curve ends at the share that succeeded.",
    "importance": "Strength of the association of factors with failure and with the tracking "
    "error; filled bars are significant (5 %, Bonferroni), + and − show the direction.",
    "sobol": "Sobol indices: bars are total indices, dots first-order ones, with 95 % intervals.",
    "two_factors": "Every flight that has both of the two most important numeric factors.",
}


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

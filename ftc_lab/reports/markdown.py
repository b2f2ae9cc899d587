"""Reports as Markdown, and as one HTML file with its pictures inside."""

import base64
import math
import re
from collections.abc import Container, Iterable, Sequence
from pathlib import Path

from ftc_lab.campaigns.statistics import Estimate
from gcs.console.extras import load_package
from mavlink_defs.config.output_files import write_text
from mavlink_defs.visible import visible_lines

_NUMBER = re.compile(r"(\*\*)?[-+−<±]?\s*\d|-$")
"""Begin of a number, perhaps bold; a dash is one that is unknown."""
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#|&~])")


def plain(text: str) -> str:
    """Return a text such that Markdown shows it as it is, on one line."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def bold(text: str, is_bold: bool = True) -> str:
    """Return a text in bold, or as it is."""
    return f"**{text}**" if is_bold and text else text


def table(
    header: Sequence[str], rows: Iterable[Sequence[object]], numbers: Container[str] = ()
) -> str:
    """Return a Markdown table; columns of numbers are right-aligned, columns of texts left.

    Args:
        header: Its headings.
        rows: Its cells.
        numbers: Headings of columns of numbers in which there are texts, too.
    """
    cells = [list(map(str, row)) for row in rows]
    columns = zip(*cells, strict=True) if cells else [()] * len(header)
    rule = [
        "---:" if name in numbers or (cells and all(map(_NUMBER.match, column))) else "---"
        for name, column in zip(header, columns, strict=True)
    ]
    lines = [header, rule, *cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def render(template: str, **values: object) -> str:
    """Return a text from a file in `templates`; each line of one in Markdown is a paragraph."""
    load_package("jinja2", "a report", "lab")
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("ftc_lab.reports"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["plain"] = plain
    environment.globals["table"] = table
    return environment.get_template(f"{template}.j2").render(values)


def bullets(sentences: Iterable[str]) -> str:
    """Return a Markdown list."""
    return "".join(f"- {sentence}\n" for sentence in sentences)


def save_markdown(path: Path, markdown: str) -> None:
    """Write a report, whose names and reasons may be anyone's.

    Raises:
        OSError: It cannot be written; it is named.
    """
    write_text(path, visible_lines(markdown))


def html_of(markdown: str, folder: Path) -> str:
    """Return the report as one HTML page that needs no other file.

    Args:
        markdown: The report; its first line is its title.
        folder: Folder of its pictures.
    """
    from markdown_it import MarkdownIt

    markdown = visible_lines(markdown)
    body = MarkdownIt("commonmark").enable("table").render(markdown)
    body = body.replace("<table>", '<div class="wide"><table>').replace(
        "</table>", "</table></div>"
    )
    body = re.sub(r'src="([^"]+\.png)"', lambda found: _embedded(folder / found[1]), body)
    return render("page.html", title=markdown.partition("\n")[0].lstrip("# "), body=body)


def _embedded(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f'src="data:image/png;base64,{data}"'


def probability(value: float) -> str:
    """Format a probability, as in "86.7 %"; a dash if it is unknown."""
    return "-" if math.isnan(value) else f"{100.0 * value:.1f} %"


def number(value: float) -> str:
    """Format a figure with four digits; a dash if it is unknown or unbounded."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


def p_value(value: float) -> str:
    """Format a p-value."""
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}" if value < 0.1 else f"{value:.2f}"


def interval(estimate: Estimate, of: str = "number") -> str:
    """Format an estimate with its interval, of a figure or of a probability."""
    show = probability if of == "probability" else number
    if not math.isfinite(estimate.value):
        return "-"
    return f"{show(estimate.value)} [{show(estimate.low)}, {show(estimate.high)}]"

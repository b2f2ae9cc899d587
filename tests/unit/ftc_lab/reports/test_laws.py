"""Tables of several laws: the same cells are bold in Markdown, in HTML and on the terminal."""

import math
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ftc_lab.reports.laws import LawRow, Value, law_markdown, law_terminal
from ftc_lab.reports.markdown import html_of

LAWS = {"a": "pid", "b": "surviving", "c": "tube"}


def row(**costs: float | tuple[float, ...]) -> LawRow:
    cells = {
        name: [Value.of(one) for one in (cost if isinstance(cost, tuple) else (cost,))]
        for name, cost in costs.items()
    }
    return LawRow(["weak"], cells)


def bold_on_terminal(table: Table) -> list[str]:
    console = Console(width=200, record=True, force_terminal=True, color_system=None)
    segments = [s for line in console.render_lines(table) for s in line]
    return [s.text for s in segments if s.style and s.style.bold and s.text.strip()[:1].isdigit()]


def test_what_a_simpler_law_beats_is_bold_everywhere() -> None:
    rows = [row(a=2.0, b=(1.9, 31.0), c=13.0), row(a=(5.0, 20.0), b=(6.0, 10.0), c=(5.2, 12.0))]
    text = law_markdown(["family"], rows, LAWS)
    assert "| weak | 2.0 | 1.9, 31.0 | **13.0** |" in text
    assert "| weak | 5.0, 20.0 | **6.0**, 10.0 | 5.2, **12.0** |" in text
    assert text.count("**Bold**") == 1
    page = html_of(f"# A title\n\n{text}", Path())
    assert page.count("<strong>") == 3 + 1
    assert bold_on_terminal(law_terminal(["family"], rows, LAWS)) == ["13.0*", "6.0*", "12.0*"]


def test_nothing_bold_needs_no_legend() -> None:
    rows = [row(a=2.0, b=1.9, c=math.nan), row(b=3.0)]
    text = law_markdown(["family"], rows, LAWS)
    assert "**" not in text
    assert "| weak |  | 3.0 |  |" in text
    assert "| --- | ---: | ---: | ---: |" in text
    assert law_terminal(["family"], rows, LAWS).caption is None


def test_a_lost_flight_is_bold_beside_one_that_was_not() -> None:
    text = law_markdown(["family"], [row(a=90.0, b=math.inf, c=0.1)], LAWS)
    assert "| weak | 90.0 | **lost** | 0.1 |" in text
    text = law_markdown(["family"], [row(a=math.inf, b=math.inf, c=math.inf)], LAWS)
    assert "| weak | lost | lost | lost |" in text

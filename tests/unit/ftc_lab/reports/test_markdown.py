"""Markdown, and the page made of it."""

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from ftc_lab.reports.markdown import bullets, html_of, table

PIXEL = bytes.fromhex("89504e470d0a1a0a")
cells = st.text(st.characters(whitelist_categories=["L", "N"]), min_size=1, max_size=8)


def test_a_page_needs_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "fig.png").write_bytes(PIXEL)
    page = html_of("# A title & more\n\n![fig](figures/fig.png)\n", tmp_path)
    assert "<title>A title &amp; more</title>" in page
    assert 'src="data:image/png;base64,iVBORw0KGgo="' in page
    assert "figures/fig.png" not in page


@given(st.lists(st.lists(cells, min_size=3, max_size=3), min_size=1, max_size=5))
def test_a_table_keeps_every_cell(rows: list[list[str]]) -> None:
    header, *body = rows
    page = html_of(table(header, body), Path())
    assert page.count("<tr>") == len(rows)
    for cell in (cell for row in rows for cell in row):
        assert f">{cell}<" in page


def test_bullets() -> None:
    assert html_of(bullets(["one", "two"]), Path()).count("<li>") == 2


def test_only_numbers_are_right_aligned() -> None:
    numbers = ["1", "-", "< 0.0001", "−3 [−4, −1]", "+0.5 ± 0.1", "12.5 %"]
    texts = ["`a`", "none", "3 of 4", "roll", "-", "x 1"]
    text = table(["numbers", "texts"], zip(numbers, texts, strict=True))
    assert text.splitlines()[1] == "| ---: | --- |"
    page = html_of(f"# T\n\n{text}", Path())
    cells = re.findall(r"<t[hd]([^>]*)>([^<]*)", page)
    assert all("right" in style for style, cell in cells if cell in {"numbers", "1", "+0.5 ± 0.1"})
    assert not any("right" in style for style, cell in cells if cell in {"texts", "none", "roll"})
    assert table(["a", "b"], []).splitlines()[1] == "| --- | --- |"

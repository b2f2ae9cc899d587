"""What commands print: no number cut at any width, no control character of anyone's text."""

import ast
import io
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich import box
from rich.live import Live
from rich.progress import Progress, TextColumn
from rich.text import Text

from gcs.console import terminal
from gcs.console.lines import print_json, print_line
from gcs.console.terminal import console_of, numbers, table_of, texts

OUTPUT = Path(terminal.__file__)
LINES = OUTPUT.with_name("lines.py")
LAB = OUTPUT.parents[2] / "ftc_lab"
SOURCES = sorted({*OUTPUT.parents[1].rglob("*.py"), *LAB.rglob("*.py")} - {OUTPUT, LINES})
NASTY = "\x1b]0;PWNED\x07\x1b[31m\x9b2J\r\u2028\u202e\udc80\x7f\x00"
RAW = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202e\ud800-\udfff]")


def printed(renderable: Any, width: int) -> str:
    """What a terminal of that width gets, without colours."""
    console = console_of(stderr=False)
    console.file, console.width = io.StringIO(), width
    console.print(renderable)
    return console.file.getvalue()


names = st.text(st.characters(exclude_categories=["C", "Z", "M"]), max_size=40)
sentences = st.lists(
    st.from_regex(r"[a-z]{1,15}|-?\d{1,7}(\.\d{1,5})?", fullmatch=True), max_size=9
)
figures = st.integers(0, 10**9).map(str) | st.floats(-1e6, 1e6).map("{:.1f} deg".format)
rows = st.lists(st.tuples(names, figures, figures, figures, names), min_size=1, max_size=4)


@given(rows, st.integers(10, 120), st.sampled_from([None, box.SIMPLE_HEAD, box.HEAVY_HEAD]))
def test_no_table_cuts_anything_at_any_width(
    content: list[tuple[str, ...]], width: int, lines: Any
) -> None:
    columns = (texts("name"), *map(numbers, ("events", "saved\n[%]", "time")), texts("kind"))
    table = table_of(*columns, title="A title", box=lines)
    for row in content:
        table.add_row(*row)
    shown = printed(table, width)
    assert "…" not in "".join(c for c in shown if all(c not in cell for r in content for cell in r))
    for row in content:
        for cell in row[1:4]:
            assert cell in shown
        for cell in (row[0], row[4]):
            assert all(shown.count(c) >= row[0].count(c) for c in cell)


@given(st.lists(st.tuples(sentences, figures), min_size=1, max_size=4), st.integers(10, 120))
def test_no_table_breaks_a_word_or_a_number(
    content: list[tuple[list[str], str]], width: int
) -> None:
    table = table_of(texts("remarks"), numbers("saved by the trigger\n[deg s]"), box=None)
    for remarks, figure in content:
        table.add_row(" ".join(remarks), figure)
    shown = printed(table, width)
    found = sorted(re.findall(r"[^\s\[\]]+", shown))
    heading = ["remarks", "saved", "by", "the", "trigger", "deg", "s"]
    cells = [word for remarks, figure in content for word in (*remarks, *figure.split())]
    assert found == sorted(heading + cells)
    assert "[deg s]" in shown
    if (widest := max(len(figure) for _, figure in content)) <= 10 and width >= 30:
        assert max(map(len, shown.splitlines())) <= max(width, 24 + 4 + widest)


def test_a_pipe_has_no_edge(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)  # workers of pytest-xdist have it
    table = table_of(texts("name"), numbers("value"))
    table.add_row("n" * 200, "1")
    console_of(stderr=False).print(table, "word " * 50)
    lines = capsys.readouterr().out.splitlines()
    assert any("n" * 200 in line for line in lines)
    assert "word " * 49 + "word" in lines[-1]


def shown_everywhere() -> None:
    """Print a nasty text by every way that commands have."""
    table = table_of(texts(NASTY), title=NASTY, caption=NASTY)
    table.add_row(NASTY)
    for stderr in (True, False):
        console = console_of(stderr)
        console.print(NASTY, Text(NASTY), Text.assemble(NASTY, (NASTY, "bold red")), table)
        print_line(NASTY, stderr=stderr)
        with Live(table, console=console) as live:
            live.update(Text(NASTY))
        with Progress(TextColumn("{task.description}", markup=False), console=console) as progress:
            progress.add_task(NASTY)
    print_json({"name": NASTY, NASTY: float("nan")})


def test_no_control_character_comes_out(capsys: pytest.CaptureFixture[str]) -> None:
    shown_everywhere()
    captured = capsys.readouterr()
    assert "PWNED" in captured.out
    assert "PWNED" in captured.err
    assert RAW.findall(captured.out) == RAW.findall(captured.err) == []


def test_no_control_character_comes_out_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    shown_everywhere()
    captured = capsys.readouterr()
    for text in (captured.out, captured.err):
        own = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\r", "", text)  # colours and moves of rich
        assert RAW.findall(own) == []


def test_output_and_tables_are_made_in_one_place() -> None:
    calls = {"Table", "Table.grid", "Console", "print", "typer.echo"}
    elsewhere = [
        f"{path}:{node.lineno} calls {called}: see gcs.console.terminal and lines"
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and (called := ast.unparse(node.func)) in calls
        if not (called == "Table" and path.parent.name == "tui")  # a dialog's is no result
    ]
    assert len(SOURCES) > 200
    assert not elsewhere, "\n".join(elsewhere)

"""The tables of README.md and docs/ are what the commands give."""

import io
import re
import shlex
from pathlib import Path
from typing import TypeAlias

import pytest
from flying import SCENARIO_1
from rich.console import Console
from typer.testing import CliRunner

from ftc_lab import reproduce
from ftc_lab.figures import sweep
from gcs.commands.cli import app
from gcs.fleet.in_process import fly_in_process
from gcs.reports.flight import flight_tables

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
EXPLANATION = ROOT / "docs" / "explanation"
RESULTS = (EXPLANATION / "results.md").read_text()
TUBE = (EXPLANATION / "tube.md").read_text()
CONTROLLERS = (EXPLANATION / "controllers.md").read_text()
FIRST_FLIGHT = (ROOT / "docs" / "tutorial" / "first-flight.md").read_text()
SWEEPS = re.findall(
    r"^    (gcs sweep .*)\n\n((?:\|.*\n)+)", RESULTS + CONTROLLERS + TUBE, re.MULTILINE
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")

Rows: TypeAlias = list[list[str]]


def cells(table: str) -> Rows:
    return [[cell.strip() for cell in line.strip("|\n").split(" |")] for line in table.splitlines()]


def tables_of(text: str) -> dict[tuple[str, ...], Rows]:
    """Rows of all Markdown tables, by their headings."""
    found = {}
    for table in re.findall(r"^(?:\|.*\n)+", text, re.MULTILINE):
        head, _, *rows = cells(table)
        found[tuple(head)] = rows
    return found


def assert_alike(ours: list[str], shown: list[str], head: list[str]) -> None:
    """Equal texts, equally bold; numbers within what another machine's arithmetic may change."""
    assert [value.startswith("**") for value in ours] == [cell.startswith("**") for cell in shown]
    ours, shown = ([value.strip("*") for value in row] for row in (ours, shown))
    tumbled = not {"completed", "heading lost"} & set(shown)
    for key, value, expected in zip(head, ours, shown, strict=True):
        if key == "reason" or (tumbled and key.startswith(("IAE", "saving", "events", "small"))):
            continue  # an aircraft that tumbles magnifies the last digit
        numbers = NUMBER.fullmatch(expected.removesuffix(" %"))
        if key.startswith("IAE") and numbers:
            assert float(value) == pytest.approx(float(expected), rel=0.005), (key, shown)
        elif key == "events":
            assert float(value) == pytest.approx(float(expected), rel=0.01), (key, shown)
        elif key == "saving":
            assert float(value[:-2]) == pytest.approx(float(expected[:-2]), abs=0.2), (key, shown)
        elif key != "smallest interval":
            assert value == expected, (key, shown)


def assert_cells_alike(ours: list[str], shown: list[str], rel: float) -> None:
    """Equal texts; numbers within what another machine's arithmetic may change."""
    for value, expected in zip(ours, shown, strict=True):
        assert NUMBER.sub("#", value) == NUMBER.sub("#", expected), (ours, shown)
        close = [pytest.approx(float(n), rel=rel, abs=0.03) for n in NUMBER.findall(expected)]
        assert [float(n) for n in NUMBER.findall(value)] == close, (ours, shown)


def section(text: str, heading: str) -> str:
    """Return the text below a heading, to the next one of any level."""
    return text.partition(f"{heading}\n")[2].partition("\n#")[0]


def test_there_are_tables() -> None:
    assert len(SWEEPS) == 16


@pytest.mark.parametrize(("command", "shown"), SWEEPS, ids=lambda text: text[-12:])
def test_a_table_is_what_its_command_gives(
    command: str, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep, "draw_sweep", lambda *_: None)  # nobody looks at it
    _, *given = shlex.split(command)
    given = given[: given.index("--out")]
    arguments = [name for word in given for name in sorted(map(str, ROOT.glob(word))) or [word]]
    done = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out"), "--quiet"])
    assert done.exit_code == 0, done.output
    table = (tmp_path / "out" / "table.md").read_text().split("\n\n")[1]
    head, _, *rows = cells(table)
    shown_head, _, *shown_rows = cells(shown)
    assert head == shown_head
    assert len(rows) == len(shown_rows)
    for ours, expected in zip(rows, shown_rows, strict=True):
        assert_alike(ours, expected, head)


def test_the_papers_tables_come_from_gcs_reproduce(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One flight of each for all: results.md, the README's table, what the first flight prints.

    Without figures and checks of the theory, which have tests of their own and take far longer.
    """
    monkeypatch.setattr(reproduce, "_draw", lambda *_: None)
    monkeypatch.setattr(reproduce, "theory_section", lambda *_: "")
    scenarios = reproduce.load_all(SCENARIO_1.parent)
    chapter = reproduce.paper_chapter(
        scenarios, lambda _, scenario: fly_in_process(scenario), 1, tmp_path, lambda _: None
    )
    report = chapter.text
    core = section(RESULTS, "## The paper's tables")
    shown, ours = tables_of(core), tables_of(report)
    assert len(shown) == 3
    for head, rows in shown.items():
        for row, expected in zip(ours[head], rows, strict=True):
            assert_cells_alike(row, expected, rel=0.005 if "IAE" in head[0] else 0.01)
    reported = re.findall(r"^- .*", section(report, "## Where ours differs, and why"), re.MULTILINE)
    listed = re.findall(r"^- .*", core, re.MULTILINE)
    assert [NUMBER.sub("#", line) for line in listed] == [
        NUMBER.sub("#", line) for line in reported
    ]

    tracking, transmissions = list(ours.values())[:2]
    saved = {row[0]: row[-1] for row in transmissions}
    (rows,) = (rows for head, rows in tables_of(README).items() if head[0] == next(iter(shown))[0])
    names = {cells[0] for cells in rows}
    flown = [[*cells, saved[cells[0]]] for cells in tracking if cells[0] in names]
    for cells, expected in zip(flown, rows, strict=True):
        assert_cells_alike(cells, expected, rel=0.005)
    summary = chapter.summaries["scenario1"]
    printed = io.StringIO()
    console = Console(file=printed, width=80, markup=False)
    for table in flight_tables(summary, scenarios["scenario1"]):
        console.print(table)
    flown, copied = printed_rows(printed.getvalue()), printed_rows(FIRST_FLIGHT)
    assert len(flown) == 15 + 9 + 12  # transmissions, links and tracking of three UAVs
    assert headings(printed.getvalue()) == headings(FIRST_FLIGHT)
    for row, expected in zip(flown, copied, strict=True):
        assert_cells_alike(row, expected, rel=0.005 if "IAE" in row[1] else 0.01)


def printed_rows(text: str) -> Rows:
    """Cells of the tables that `gcs fly` prints."""
    lines = [line.strip().strip("│") for line in text.splitlines() if line.count("│") > 3]
    return [[cell.strip() for cell in line.split("│")] for line in lines]


def headings(text: str) -> Rows:
    """Headings of the tables that `gcs fly` prints."""
    lines = [line.strip().strip("┃") for line in text.splitlines() if "┃" in line]
    return [[cell.strip() for cell in line.split("┃")] for line in lines]

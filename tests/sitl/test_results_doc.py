"""The tables of docs/results.md are what the commands above them give."""

import re
import shlex
from pathlib import Path

import pytest
from flying import run

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "results.md").read_text()
SWEEPS = re.findall(r"^    (gcs sweep .*)\n\n((?:\|.*\n)+)", TEXT, re.MULTILINE)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def cells(table: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|\n").split(" |")] for line in table.splitlines()]


def assert_alike(ours: list[str], shown: list[str], head: list[str]) -> None:
    """Equal words; numbers within what another machine's arithmetic may change."""
    tumbled = not {"completed", "heading lost"} & set(shown)
    for key, value, expected in zip(head, ours, shown, strict=True):
        if key == "reason" or (tumbled and key.startswith(("IAE", "saving", "events", "small"))):
            continue  # an aircraft that tumbles magnifies the last digit
        numbers = NUMBER.fullmatch(expected.removesuffix(" %"))
        if key.startswith("IAE") and numbers:
            assert float(value) == pytest.approx(float(expected), rel=0.02), (key, shown)
        elif key == "events":
            assert float(value) == pytest.approx(float(expected), rel=0.1), (key, shown)
        elif key == "saving":
            assert float(value[:-2]) == pytest.approx(float(expected[:-2]), abs=2.0), (key, shown)
        elif key != "smallest interval":
            assert value == expected, (key, shown)


def test_there_are_tables() -> None:
    assert len(SWEEPS) == 5


@pytest.mark.parametrize(("command", "shown"), SWEEPS, ids=lambda text: text[-12:])
def test_a_table_is_what_its_command_gives(command: str, shown: str, tmp_path: Path) -> None:
    _, *words = shlex.split(command)
    words = words[: words.index("--out")]
    arguments = [name for word in words for name in sorted(map(str, ROOT.glob(word))) or [word]]
    done = run("gcs", *arguments, "--out", tmp_path / "out", "--quiet")
    assert done.returncode == 0, done.stderr
    table = (tmp_path / "out" / "table.md").read_text().partition("\n\n")[2]
    head, _, *rows = cells(table)
    shown_head, _, *shown_rows = cells(shown)
    assert head == shown_head
    assert len(rows) == len(shown_rows)
    for ours, expected in zip(rows, shown_rows, strict=True):
        assert_alike(ours, expected, head)

"""The words that the glossary retires are used on no page, in no scenario and in no code."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs/explanation/glossary.md"
PLACES = (
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs", "scenarios", "hatch_build.py"),
    *("gcs", "ftc_lab", "ftc_autopilot", "sitl_plant", "mavlink_defs"),
    *("benchmarks", "fuzzing", "soak", "scripts"),
)
SUFFIXES = {".md", ".yaml", ".py", ".xml", ".j2", ".tcss", ""}
NOT_OURS = {
    "docs/explanation/glossary.md",  # which names them
    "mavlink_defs/dialect.py",  # generated; most of it describes MAVLink's own messages
}
ALLOWED = {  # another meaning of the same word, or a published name
    "words": r"(?:32-bit|64-bit|seven) words|words for each array",
    "life": r"life cycle",
    "*_kept": r"(?:attitude|heading)_kept",  # published names of outcomes
    "storm": r"storm_(?:events|s)\b",  # parameters of the law tube
    "rescue": r"rescue_(?:deg|rad)\b",  # a parameter of the law tube, and its field in rad
}


def retired(page: str) -> list[str]:
    """The words of the first column of the table *Retired words*."""
    table = page.split("## Retired words")[1]
    rows = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    return [word for row in rows for word in re.findall(r"`([^`]+)`", row)]


def pattern(word: str) -> re.Pattern[str]:
    """Of a word on its own or as a part of a name; across the end of a line, in comments too."""
    if "*" in word:
        cased = word.replace("*", r"\w+")
        return re.compile(rf"\b{cased}\b")
    text = word.replace(" ", r"(?:_|\s+(?:[#>*]+\s+)?)")
    return re.compile(rf"(?<![^\W_]){text}(?![^\W_])", re.IGNORECASE)


def uses(word: str, text: str) -> list[int]:
    """The lines in which a word is used."""
    if word in ALLOWED:
        text = re.sub(ALLOWED[word], "", text, flags=re.IGNORECASE)
    return [text.count("\n", 0, found.start()) + 1 for found in pattern(word).finditer(text)]


@cache
def texts() -> dict[str, str]:
    """Every file of the project that people write, by its path."""
    found = {}
    for top in (ROOT / place for place in PLACES):
        for path in sorted(top.rglob("*")) if top.is_dir() else [top]:
            name = str(path.relative_to(ROOT))
            if path.is_file() and path.suffix in SUFFIXES and name not in NOT_OURS:
                found[name] = path.read_text()
    return found


def test_a_retired_word_is_used_nowhere() -> None:
    found = [
        f"{name}:{line}: {word}, for which the glossary has another"
        for word in retired(GLOSSARY.read_text())
        for name, text in texts().items()
        for line in uses(word, text)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("word", "text", "line"),
    [
        ("anew", "begins\nAnew.", 2),
        ("that of", "as fine as that\n    # of a flight", 1),
        ("words", "reason_words = 1", 1),
        ("take up", "def take_up(): ...", 1),
        ("kept_*", "\n\nkept_file = 1", 3),
        ("Kept*", "class KeptState:", 1),
    ],
)
def test_a_use_is_found(word: str, text: str, line: int) -> None:
    assert uses(word, text) == [line]


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("words", "a row of 32-bit words"),
        ("told", "stoldt"),
        ("kept_*", "attitude kept"),
        ("Kept*", "Kept until the end."),
        ("that of", "thatof"),
    ],
)
def test_another_word_is_not_found(word: str, text: str) -> None:
    assert uses(word, text) == []

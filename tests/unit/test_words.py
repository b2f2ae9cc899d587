"""Words of pages, scenarios and code: none that the glossary retires, none twice, no lost name."""

import io
import re
import tokenize
from collections.abc import Iterator
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
    "storm": r"storm_(?:events|s)\b",  # names of before, of renamed keys
    "rescue": r"rescue_deg\b",  # the same
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


@cache
def lowered(text: str) -> str:
    """A text in small letters."""
    return text.lower()


def uses(word: str, text: str) -> list[int]:
    """The lines in which a word is used."""
    if word.strip("*").split()[0].lower() not in lowered(text):  # sooner found than by a pattern
        return []
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


TWICE = re.compile(r"(?<![\w.*/'-])([a-z]+)[ \n]+\1(?![\w.*/-])", re.IGNORECASE)
BACK_TICKED = re.compile(r"(?<!`)`([A-Za-z_]\w*(?:\.\w+)*)(?:\(\))?`(?!`)")
OUR_OWN = re.compile(r"`((?:gcs|ftc_lab|ftc_autopilot|sitl_plant|mavlink_defs)\.[\w.]+)`")


@cache
def parts_of_code(text: str) -> tuple[tuple[bool, str], ...]:
    """Docstrings and whole lines of comments, which are prose, and all else."""
    return tuple(tokens_of(text))


def tokens_of(text: str) -> Iterator[tuple[bool, str]]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        alone = not token.line[: token.start[1]].strip()
        is_text = token.type == tokenize.STRING and token.string.endswith('"""')
        if token.type == tokenize.COMMENT or (alone and is_text):
            lines = [line.strip().lstrip("#: ") for line in token.string.split("\n")]
            yield True, "\n".join(lines) + ("\n" if alone else "|\n")
        elif token.type in {tokenize.NAME, tokenize.STRING}:
            yield False, token.string


def prose_of(name: str, text: str) -> str:
    """The sentences of a file: of code and scenarios its comments; of pages what is not code."""
    if name.endswith(".py"):
        return "".join(part for is_prose, part in parts_of_code(text) if is_prose)
    if name.endswith(".md"):
        text = re.sub(r"```.*?```|^(?:    |#).*$", "|", text, flags=re.DOTALL | re.MULTILINE)
        return re.sub(r"`[^`\n]*`", "|", text)
    return "\n".join(re.findall(r"^ *# ?(.*)$", text, re.MULTILINE))


@cache
def names_of_code() -> set[str]:
    """Every name that code and scenarios have, those within texts and of files as well."""
    parts = list(texts())
    for name, text in texts().items():
        if name.endswith(".py"):
            parts += [part for is_prose, part in parts_of_code(text) if not is_prose]
        elif name.endswith(".yaml"):
            parts.append(text)
    return set(re.findall(r"\w+", " ".join(parts)))


def lost(name: str, text: str) -> list[str]:
    """Names between back-ticks that no code has: in code every name, on pages those of our own."""
    if name.endswith(".py"):
        text, named = prose_of(name, text), BACK_TICKED
    else:
        named = OUR_OWN
    found = named.findall(text)
    return [one for one in found if not set(re.findall(r"\w+", one)) <= names_of_code()]


def test_no_word_stands_twice() -> None:
    twice = [
        f"{name}: {found[0]!r}"
        for name, text in texts().items()
        for found in TWICE.finditer(prose_of(name, text))
    ]
    assert not twice, "\n".join(twice)


def test_a_name_between_back_ticks_exists() -> None:
    found = [f"{name}: {one}" for name, text in texts().items() for one in lost(name, text)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("name", "text", "twice", "gone"),
    [
        ("a.py", 'x = 1\n"""The Kalman\nkalman of `no_such`, `texts`, ``no_other``."""\n', 1, 1),
        ("a.py", "a = 1  # rad\nb = 2  # rad\n# the\n# the end\nc = b * b\n", 1, 0),
        ("a.md", "Is is\n\n    gcs gcs\n\nof `gcs gcs`, `gcs.no_such` and `no.matter`", 1, 1),
        ("a.yaml", "# in in\nfor: for\n", 1, 0),
    ],
)
def test_what_stands_twice_or_is_lost_is_found(name: str, text: str, twice: int, gone: int) -> None:
    assert len(TWICE.findall(prose_of(name, text))) == twice
    assert len(lost(name, text)) == gone

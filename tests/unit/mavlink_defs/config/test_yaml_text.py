"""YAML of any depth and meaning is read or refused, and what is written reads back."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_defs.config.user_files import MAX_FILE
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of, yaml_problem

REFUSED = (yaml.YAMLError, RecursionError, ValueError)
ROOT = Path(__file__).parents[4]
WITHOUT_LIBYAML = """
import json, sys
sys.modules["yaml._yaml"] = None
from mavlink_defs.config.yaml_text import parse_yaml, yaml_problem
for text in json.load(sys.stdin):
    try:
        print(repr(parse_yaml(text)))
    except Exception as refused:
        print(repr(yaml_problem(refused)[0]))
"""
TEXTS = st.text(st.characters(codec="utf-8"))
KEYS = TEXTS | st.integers()
LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, width=64) | TEXTS
TREES = st.recursive(
    LEAVES, lambda v: st.lists(v, max_size=4) | st.dictionaries(KEYS, v, max_size=4), max_leaves=12
)


def test_what_is_read_is_the_reader_s_own() -> None:
    text = "uavs: [{id: 1}, {id: 2}]"
    tree = parse_yaml(text, "a.yaml")
    tree["uavs"][0]["id"] = 3
    tree["uavs"].pop()
    tree["uavs"].sources.clear()
    del tree.sources["uavs"]
    again = parse_yaml(text, "a.yaml")
    assert again == {"uavs": [{"id": 1}, {"id": 2}]}
    assert again.sources == {"uavs": "a.yaml:1"}
    assert again["uavs"].sources == {0: "a.yaml:1", 1: "a.yaml:1"}
    assert parse_yaml(text, "b.yaml").sources == {"uavs": "b.yaml:1"}


@given(TREES)
def test_what_is_written_reads_back(tree: Any) -> None:
    assume_one_key_per_text(tree)
    again = parse_yaml(yaml_of(tree), "file")
    assert again == tree
    assert repr(parse_yaml(yaml_of(again))) == repr(tree), "types, too: 1 is not 1.0, nor true"


def assume_one_key_per_text(tree: Any) -> None:
    """Keys 1 and "1" are one key for the check of duplicates."""
    if isinstance(tree, dict):
        assume(len({str(key) for key in tree}) == len(tree))
        tree = list(tree.values())
    if isinstance(tree, list):
        for part in tree:
            assume_one_key_per_text(part)


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? ", "[{", "{? ", "!!seq ["])
def test_depth_without_end_is_refused(opening: str) -> None:
    text = opening * (MAX_FILE // len(opening))
    with pytest.raises(REFUSED) as caught:
        parse_yaml(text)
    assert yaml_problem(caught.value)[1] == "not YAML: nested too deeply"


@pytest.mark.parametrize("kind", ["[{}]", "{{{}}}", "{{<<: [{}]}}"])
def test_aliases_that_multiply_are_refused(kind: str) -> None:
    lines = ["a0: &a0 {x: 1, y: 2}"]
    for level in range(1, 30):
        inner = [f"*a{level - 1}"] * 9
        listed = ", ".join(f"k{i}: {a}" for i, a in enumerate(inner)) if "{{" in kind else ""
        body = kind.format(listed if listed and "<<" not in kind else ", ".join(inner))
        lines.append(f"a{level}: &a{level} {body}")
    with pytest.raises(yaml.MarkedYAMLError, match="repeat more than 1000000 values"):
        parse_yaml("\n".join(lines))


@pytest.mark.parametrize("text", ["a: &a {b: *a}", "&a [*a]", "a: &a {<<: *a}", "&a {? *a : 1}"])
def test_an_alias_inside_of_what_it_means_is_refused(text: str) -> None:
    with pytest.raises(yaml.MarkedYAMLError, match="alias of what it is in"):
        parse_yaml(text)


WRONG = [
    ("a: 1\nb: 2\na: 3\n", ":3:1"),
    ("{a: 1, a: 2}", ":1:8"),
    ("é: 1\nü: {é: 1, é: 2}\n", ":2:11"),
    ("a: 1\n\tb: 2\n", ":2:1"),
    ("a: 1: 2\n", ":1:5"),
    ("a: *b\n", ":1:4"),
    ("a:\n  b: !!python/name:os 1\n", ":2:6"),
]


@pytest.mark.parametrize(("text", "place"), WRONG)
def test_what_is_no_yaml_names_line_and_column(text: str, place: str) -> None:
    with pytest.raises(REFUSED) as caught:
        parse_yaml(text, "file")
    assert yaml_problem(caught.value)[0] == place


def test_without_libyaml_the_same_is_read_and_refused() -> None:
    """A new Python for which PyYAML has no wheel: pip builds one, without libyaml."""
    folders = (ROOT / "scenarios" / "paper", ROOT / "scenarios" / "faults", ROOT / "aircraft")
    texts = [path.read_text() for folder in folders for path in sorted(folder.glob("*.yaml"))]
    assert len(texts) > 30
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_LIBYAML],
        input=json.dumps([*texts, *(text for text, _ in WRONG)]),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    expected = [*map(parse_yaml, texts), *(place for _, place in WRONG)]
    assert done.stdout.splitlines() == [*map(repr, expected)]

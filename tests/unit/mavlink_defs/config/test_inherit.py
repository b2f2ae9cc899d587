import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_defs.config.inherit import (
    PlaceError,
    difference,
    merged,
    read_inherited,
    with_values,
)
from mavlink_defs.config.models import ConfigError, Loc, Problem
from mavlink_defs.config.written import located, written_in

KNOWN = ("a", "b", "c", "d")

LEAVES = st.integers() | st.booleans() | st.sampled_from(["x", "y"])


def mappings(keys: list[str | int], values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.dictionaries(st.sampled_from(keys), values, max_size=4)


def values(keys: list[str | int]) -> st.SearchStrategy[Any]:
    return st.recursive(LEAVES, lambda v: st.lists(v, max_size=3) | mappings(keys, v), max_leaves=8)


PLAIN: list[str | int] = ["a", "b", "c", 1]
ALL = [*PLAIN, "kind"]
PLAIN_TREES = mappings(PLAIN, values(PLAIN))
TREES = mappings(ALL, values(ALL))
OVERLAYS = mappings(ALL, values(ALL) | st.none())


def paths(tree: Any) -> list[tuple[Any, ...]]:
    """Ways to all values of nested mappings that are no mappings themselves."""
    if not isinstance(tree, dict):
        return [()]
    return [(key, *way) for key, value in tree.items() for way in paths(value)]


def at(tree: Any, way: tuple[Any, ...]) -> Any:
    for key in way:
        tree = tree[key]
    return tree


def clash(a: Any, b: Any) -> bool:
    """Return whether one has a mapping where the other has something else."""
    if isinstance(a, dict) and isinstance(b, dict):
        return any(clash(a[key], b[key]) for key in a.keys() & b.keys())
    return isinstance(a, dict) or isinstance(b, dict)


@given(PLAIN_TREES, PLAIN_TREES, PLAIN_TREES)
def test_it_does_not_matter_which_two_of_three_are_merged_first(a: Any, b: Any, c: Any) -> None:
    assume(not (clash(a, b) or clash(b, c) or clash(a, c)))
    assert merged(merged(a, b), c) == merged(a, merged(b, c))


@given(TREES, OVERLAYS)
def test_overlay_wins(base: Any, overlay: Any) -> None:
    new = merged(base, overlay)
    for way in paths(overlay):
        if at(overlay, way) is not None:
            assert at(new, way) == at(overlay, way)
        else:
            assert way[-1] not in at(new, way[:-1])
    assert merged(new, overlay) == new


@given(TREES, OVERLAYS)
def test_what_goes_in_stays_as_it_is(base: Any, overlay: Any) -> None:
    before = copy.deepcopy((base, overlay))
    merged(base, overlay)
    assert (base, overlay) == before


@given(TREES)
def test_nothing_over_a_tree_and_a_tree_over_itself_change_nothing(tree: Any) -> None:
    assert merged(tree, {}) == merged({}, tree) == merged(tree, tree) == tree


@given(PLAIN_TREES, PLAIN_TREES)
def test_what_the_overlay_does_not_mention_is_the_bases(base: Any, overlay: Any) -> None:
    new = merged(base, overlay)
    assert new.keys() == base.keys() | overlay.keys()
    for key in base.keys() - overlay.keys():
        assert new[key] == base[key]


LAW: dict[str, Any] = {"kind": "proposed", "c_v": 10.0, "rbf": {"neurons": 15, "span": 1.5}}


@pytest.mark.parametrize(
    ("overlay", "result"),
    [
        ({"kind": "pid"}, {"kind": "pid"}),
        ({"kind": "pid", "p": 1, "q": None}, {"kind": "pid", "p": 1}),
        ({"kind": "proposed", "c_v": 9}, {**LAW, "c_v": 9}),
        ({"rbf": {"span": 2}}, {**LAW, "rbf": {"neurons": 15, "span": 2}}),
        ({"rbf": None}, {"kind": "proposed", "c_v": 10.0}),
        ({"kind": None, "p": 1}, {"p": 1}),
        ({"c_v": [1, 2], "rbf": 3}, {"kind": "proposed", "c_v": [1, 2], "rbf": 3}),
        ({"c_v": {"x": None, "y": 1}}, {**LAW, "c_v": {"y": 1}}),
    ],
)
def test_merging(overlay: Any, result: Any) -> None:
    assert merged({"law": LAW, "a": [1]}, {"law": overlay}) == {"law": result, "a": [1]}


def test_a_trigger_of_another_mode_inherits_the_thresholds_alone() -> None:
    base = {"mode": "scaled", "b2_deg": 0.4, "a1": 0.01, "within_s": 0.05}
    periodic = {"mode": "periodic", "b2_deg": 0.4, "a1": 0.01}
    assert merged(base, {"mode": "periodic"}) == periodic
    assert merged(base, {"mode": "scaled", "a1": 0.02}) == {**base, "a1": 0.02}
    assert merged(base, {"mode": None}) == {k: v for k, v in base.items() if k != "mode"}
    tree = {"trigger": base}
    assert with_values(tree, {"trigger.mode": "periodic"}) == {"trigger": periodic}
    for own in ({}, {"within_s": 0.05}, {"period_s": 0.004}):
        assert merged(base, difference(base, periodic | own)) == periodic | own
    autopilot = {"kind": "ardupilot", "mode": "AUTO", "binary": "arduplane"}
    assert merged(autopilot, {"mode": "CRUISE"}) == {**autopilot, "mode": "CRUISE"}


def test_a_kind_where_there_was_none_inherits_nothing() -> None:
    assert merged({"c_v": 10.0}, {"kind": "pid"}) == {"kind": "pid"}


# files


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], Path]:
    def to(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return to


def test_a_chain_is_read_from_its_far_end(write: Callable[[str, str], Path]) -> None:
    write("far/root.yaml", "a: 1\nb: {x: 1, y: 1}\nc: [1, 2]\n")
    write("far/middle.yaml", "extends: root.yaml\nb: {x: 2}\nc: [3]\n")
    top = write("top.yaml", "extends: far/middle.yaml\nb: {z: 3}\na:\n")
    assert read_inherited(top, KNOWN) == {"b": {"x": 2, "y": 1, "z": 3}, "c": [3]}


def test_a_file_without_a_base_is_read_as_it_is(write: Callable[[str, str], Path]) -> None:
    assert read_inherited(write("one.yaml", "a:\nb: {kind: }\n"), KNOWN) == {
        "a": None,
        "b": {"kind": None},
    }


def test_two_files_may_have_one_base(write: Callable[[str, str], Path]) -> None:
    write("root.yaml", "a: 1")
    write("left.yaml", "extends: ./root.yaml\nb: 1")
    top = write("top.yaml", "extends: left.yaml\nc: 1")
    assert read_inherited(top, KNOWN) == {"a": 1, "b": 1, "c": 1}


def test_of_several_bases_each_is_merged_into_those_before_it(
    write: Callable[[str, str], Path],
) -> None:
    write("first.yaml", "{a: 1, b: 1, c: 1, d: {x: 1, y: 1}}")
    write("second.yaml", "{b: 2, c: null, d: {y: 2}}")
    top = write("top.yaml", "extends: [first.yaml, second.yaml]\nb: 3")
    assert read_inherited(top, KNOWN) == {"a": 1, "b": 3, "d": {"x": 1, "y": 2}}


@pytest.mark.parametrize(
    ("files", "problem"),
    [
        ({"top": "extends: none.yaml"}, "{top}:1: extends: {none}: no such file"),
        ({"top": "extends: ."}, "{top}:1: extends: {folder}: expected a file, got a folder"),
        (
            {"top": "extends:"},
            "{top}:1: extends: expected the path of a file, or a list of them, got nothing",
        ),
        (
            {"top": "extends: ''"},
            "{top}:1: extends: expected the path of a file, or a list of them, got ''",
        ),
        (
            {"top": "extends: 3"},
            "{top}:1: extends: expected the path of a file, or a list of them, got 3",
        ),
        (
            {"top": "extends: [a.yaml, 3]"},
            "{top}:1: extends: expected the path of a file, or a list of them, got a list of 2",
        ),
        (
            {"top": "extends: []"},
            "{top}:1: extends: expected the path of a file, or a list of them, got a list of 0",
        ),
        ({"top": "extends: top.yaml"}, "{top}:1: extends: {top}: extends itself"),
        (
            {"top": "extends: middle.yaml", "middle": "extends: top.yaml"},
            "{top}:1: extends: {middle}:1: extends: {top}: extends itself",
        ),
        (
            {"top": "extends: middle.yaml", "middle": "extends: none.yaml"},
            "{top}:1: extends: {middle}:1: extends: {none}: no such file",
        ),
        (
            {"top": "extends: middle.yaml", "middle": "a: 1\na: 2"},
            "{top}:1: extends: {middle}:2:1: not YAML",
        ),
        (
            {"top": "extends: middle.yaml", "middle": "[1, 2]"},
            "{top}:1: extends: {middle}: expected a mapping, got something else",
        ),
    ],
)
def test_a_base_that_cannot_be_is_refused_in_one_line(
    write: Callable[[str, str], Path], tmp_path: Path, files: dict[str, str], problem: str
) -> None:
    for name, text in files.items():
        write(f"{name}.yaml", text)
    with pytest.raises(ConfigError) as caught:
        read_inherited(tmp_path / "top.yaml", KNOWN)
    places = {name: tmp_path / f"{name}.yaml" for name in ("top", "middle", "none")}
    assert str(caught.value) == problem.format(**places, folder=tmp_path)


# single places


TREE: dict[str, Any] = {
    "trigger": {"b2_deg": 1.0},
    "controller": LAW,
    "faults": [{"uav": 3}, {"uav": 1}],
    "grid": [[1, 2], [3]],
    "access": {1: 1.0},
    "duration_s": 24.0,
}


@pytest.mark.parametrize(
    ("place", "value", "found"),
    [
        ("trigger.b2_deg", 0.5, TREE | {"trigger": {"b2_deg": 0.5}}),
        ("trigger.a1", 0.5, TREE | {"trigger": {"b2_deg": 1.0, "a1": 0.5}}),
        ("trigger", {"a1": 0.5}, TREE | {"trigger": {"b2_deg": 1.0, "a1": 0.5}}),
        ("faults[1].uav", 2, TREE | {"faults": [{"uav": 3}, {"uav": 2}]}),
        ("faults[0]", {"uav": 2}, TREE | {"faults": [{"uav": 2}, {"uav": 1}]}),
        ("faults", [], TREE | {"faults": []}),
        ("grid[0][1]", 9, TREE | {"grid": [[1, 9], [3]]}),
        ("access.1", 2.0, TREE | {"access": {1: 2.0}}),
        ("uncertainty.inertia.Jxx", 1.1, TREE | {"uncertainty": {"inertia": {"Jxx": 1.1}}}),
        ("controller.kind", "pid", TREE | {"controller": {"kind": "pid"}}),
        ("controller.c_v", [5, 6], TREE | {"controller": LAW | {"c_v": [5, 6]}}),
        ("trigger", None, {key: value for key, value in TREE.items() if key != "trigger"}),
    ],
)
def test_a_value_is_set(place: str, value: Any, found: Any) -> None:
    before = copy.deepcopy(TREE)
    assert with_values(TREE, {place: value}) == found
    assert before == TREE


@pytest.mark.parametrize(
    ("place", "problem"),
    [
        ("duration_s.x", "expected a mapping at duration_s, got 24.0"),
        ("duration_s[0]", "expected a list of more than 0 at duration_s, got 24.0"),
        ("trigger[0]", "expected a list of more than 0 at trigger, got a mapping"),
        ("faults.uav", "expected a mapping at faults, got a list of 2"),
        ("faults[2].uav", "expected a list of more than 2 at faults, got a list of 2"),
        ("faults[0].uav.x", "expected a mapping at faults[0].uav, got 3"),
        ("nothing[0].x", "expected a list of more than 0 at nothing, got a mapping"),
        *(
            (place, "expected keys and indices as in trigger.b2_deg or faults[0].uav")
            for place in ("", ".a", "a.", "a..b", "[0]", "a[-1]", "a[x]", "a[0]b", "a b", "a\n")
        ),
    ],
)
def test_a_place_that_cannot_be_is_refused(place: str, problem: str) -> None:
    with pytest.raises(PlaceError) as caught:
        with_values(TREE, {place: 1})
    assert str(caught.value) == f"{place}: {problem}"


def test_values_are_set_one_after_the_other() -> None:
    values = {"controller.kind": "pid", "controller.p": 3.0, "faults[0].uav": 1, "faults[1].uav": 2}
    new = with_values(TREE, values)
    assert new["controller"] == {"kind": "pid", "p": 3.0}
    assert new["faults"] == [{"uav": 1}, {"uav": 2}]
    assert with_values(TREE, {}) == TREE


def test_what_an_anchor_shares_is_changed_only_where_it_is_said(
    write: Callable[[str, str], Path],
) -> None:
    tree = read_inherited(write("a.yaml", "a: [&x {v: 1}, *x]\nb: *x\n"), KNOWN)
    assert with_values(tree, {"a[0].v": 2}) == {"a": [{"v": 2}, {"v": 1}], "b": {"v": 1}}


@given(PLAIN_TREES, st.lists(st.sampled_from("abc"), min_size=1), LEAVES)
def test_setting_by_keys_is_merging(tree: Any, keys: list[str], value: Any) -> None:
    overlay: Any = value
    for key in reversed(keys):
        overlay = {key: overlay}
    assume(not clash(tree, overlay))
    assert with_values(tree, {".".join(keys): value}) == merged(tree, overlay)


@given(TREES, TREES)
def test_a_difference_makes_one_tree_of_the_other(base: Any, tree: Any) -> None:
    before = copy.deepcopy(base)
    assert repr(sorted_keys(merged(base, difference(base, tree)))) == repr(sorted_keys(tree))
    assert base == before


@given(TREES)
def test_equal_trees_differ_by_nothing(tree: Any) -> None:
    assert difference(tree, copy.deepcopy(tree)) == {}


def sorted_keys(tree: Any) -> Any:
    """The tree with its mappings in one order, as a text tells 1 from True."""
    if isinstance(tree, dict):
        return [(key, sorted_keys(tree[key])) for key in sorted(tree, key=str)]
    return [sorted_keys(value) for value in tree] if isinstance(tree, list) else tree


# where a value is written


def check_at(tree: Any, *loc: str | int) -> str:
    """Where a problem of this place is said to be, the folder apart."""
    (problem,) = located(tree, [Problem(loc, "wrong")])
    return problem.source.rpartition("/")[2]


def test_a_problem_names_the_file_and_line_that_wrote_the_value(
    write: Callable[[str, str], Path],
) -> None:
    write("root.yaml", "a:\n  x: 1\n  y: 1\n  law:\n    kind: pid\n    gain: 3\nb: [1,\n 2]\n")
    write("middle.yaml", "extends: root.yaml\na:\n  y:\n    2\n  law: {kind: tube}\n")
    top = write("top.yaml", "extends: middle.yaml\nb:\n- 1\n- {v: 2}\nc: {1: 3}\nd: &d\n  v: 3\n")
    tree = read_inherited(top, KNOWN)
    assert check_at(tree, "a") == "middle.yaml:2"
    assert check_at(tree, "a", "x") == "root.yaml:2"
    assert check_at(tree, "a", "y") == "middle.yaml:3"
    assert check_at(tree, "a", "z") == "middle.yaml:2", "missing: the mapping that lacks it"
    assert check_at(tree, "a", "law", "gain") == "middle.yaml:5", "not inherited by another kind"
    assert check_at(tree, "b", 0) == "top.yaml:3"
    assert check_at(tree, "b", 1, "v") == "top.yaml:4"
    assert check_at(tree, "b", 2) == "top.yaml:2"
    assert check_at(tree, "c", "1") == "top.yaml:5", "pydantic's keys are texts"
    assert check_at(tree, "d", "v") == "top.yaml:7"
    assert check_at(tree, "e") == check_at(tree) == ""


def test_a_value_that_was_set_is_not_said_to_be_in_the_file(
    write: Callable[[str, str], Path],
) -> None:
    tree = read_inherited(write("a.yaml", "a: {x: 1, y: 1}\nb: [{v: 1}, {v: 2}]\n"), KNOWN)
    values = {"a.x": 2, "b[0].v": 3, "c.new": 1, "d": {"x": [1]}}
    new = with_values(tree, values, "--set")
    laid: list[Loc] = [("a", "x"), ("b", 0, "v"), ("c", "new"), ("c",), ("d", "x", 0)]
    for loc in laid:
        assert check_at(new, *loc) == "--set", loc
    kept: list[Loc] = [("a", "y"), ("b", 1, "v"), ("b", 0)]
    for loc in kept:
        assert check_at(new, *loc).startswith("a.yaml:"), loc
    anonymous = with_values(tree, values)
    for loc in laid[:2]:
        assert check_at(anonymous, *loc) == "", loc
    assert check_at(tree, "a", "x") == "a.yaml:1", "what goes in stays as it is"


@given(TREES, OVERLAYS)
def test_every_value_of_a_merged_tree_is_where_it_was_written(base: Any, overlay: Any) -> None:
    new = merged(written_in(base, "base"), written_in(overlay, "overlay"))
    assert new == merged(base, overlay)
    for way in paths(new):
        if way and overlay.get("kind", base.get("kind")) == base.get("kind"):
            leaf = at(new, way)
            source = check_at(new, *way)
            written = at(base if source == "base" else overlay, way)
            assert written == leaf or (written == {} == leaf)


# what others must not see


SECRETS = [
    "user: admin\npassword: hunter2\n",
    "name: production\npassword: hunter2\n",
    '{"auths": {"registry": "hunter2"}}',
    "password: hunter2\npassword: hunter2\n",
    "password: !hunter2 x\n",
    "hunter2: *hunter2\n",
    "hunter2: 'hunter2\n",
    "- hunter2\n",
    "hunter2\n",
    "[hunter2]: 1\n",
    "42002",
    "a:\n\thunter2: 1\n",
]


@pytest.mark.parametrize("secret", SECRETS)
@pytest.mark.parametrize("above", [(), ("middle.yaml",)])
def test_nothing_of_a_base_that_is_none_is_shown(
    write: Callable[[str, str], Path], secret: str, above: tuple[str, ...]
) -> None:
    write("secret", secret)
    write("middle.yaml", "extends: secret\n")
    top = write("top.yaml", f"extends: {next(iter(above), 'secret')}\na: 1\n")
    for path, is_base in ((top, False), (top.parent / "secret", True)):
        with pytest.raises(ConfigError) as caught:
            read_inherited(path, ("name", "a"), is_base=is_base)
        (line,) = str(caught.value).splitlines()
        for word in ("hunter2", "password", "admin", "production", "auths", "user", "42002"):
            assert word not in line.replace(str(path.parent), "")


def test_the_typo_in_a_base_is_found_by_its_line(write: Callable[[str, str], Path]) -> None:
    write("base.yaml", "name: x\nduration: 3\n")
    top = write("top.yaml", "extends: base.yaml\n")
    with pytest.raises(ConfigError, match=r"base.yaml:2: unknown key; did you mean 'duration_s'\?"):
        read_inherited(top, ("name", "duration_s"))

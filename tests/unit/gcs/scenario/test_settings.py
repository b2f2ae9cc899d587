"""Axes as the command line gives them."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.console.errors import BadInput
from gcs.scenario.settings import Axis, cells, label, parse_axes
from mavlink_defs.config.models import repeated
from mavlink_defs.config.written import WrittenDict, WrittenList

plain = st.recursive(
    st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner),
    max_leaves=5,
)


def test_values_are_yaml() -> None:
    text = "k=1, 0.5,1e-3,joint,[40, 40.0, 40],{until_s: 14, value: 1},'a,b',null,true"
    mapping = {"until_s": 14, "value": 1}
    values = (1, 0.5, 1e-3, "joint", [40, 40.0, 40], mapping, "a,b", None, True)
    assert parse_axes([text]) == [Axis("k", values)]
    types = {WrittenList: list, WrittenDict: dict}
    found = [type(value) for value in parse_axes([text])[0].values]
    assert [types.get(kind, kind) for kind in found] == [type(v) for v in values]


@given(st.lists(plain, min_size=1, unique_by=label).filter(lambda v: not repeated(cells(v))))
def test_any_plain_values_come_back(values: list[Any]) -> None:
    text = ", ".join(json.dumps(value).replace("Infinity", ".inf") for value in values)
    (axis,) = parse_axes([f"some.key = {text}"])
    assert axis == Axis("some.key", tuple(values))


@given(st.text())
def test_any_text_is_an_axis_or_one_clear_message(text: str) -> None:
    axes, text = [], ""
    try:
        axes = parse_axes([text])
    except BadInput as problem:
        text = f"{problem} {problem.hint}"
    assert bool(axes) != ("--set" in text and len(text.splitlines()) == 1)


@pytest.mark.parametrize(
    "text",
    ["k", "k=", "=1", "k=1,,2", "k=[1", "k=1], [2", "k=&a [*a]", "k=!!binary x", "k=1 # one", ""],
)
def test_what_is_no_axis(text: str) -> None:
    with pytest.raises(BadInput, match="expected KEY=VALUE"):
        parse_axes([text])


def test_nothing_is_given_twice() -> None:
    with pytest.raises(BadInput, match="k is given twice"):
        parse_axes(["k=1", "k=2"])
    with pytest.raises(BadInput, match=r"got 1\.0 again"):
        parse_axes(["k=1,2,1"])

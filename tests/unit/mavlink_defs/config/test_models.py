import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, model_validator

from mavlink_defs.config.files import dump, load
from mavlink_defs.config.models import (
    ConfigError,
    HostPort,
    Model,
    Problems,
    SystemId,
    counted,
)
from mavlink_defs.config.problems import unknown_key
from mavlink_defs.config.quantity import Quantity, describe, quantity, whole


class Wing(Model):
    area_m2: float = quantity("m^2", gt=0.0, doc="Reference area S.")
    limit_rad: float = quantity("rad", ge=0.0, le=0.8, default=0.5, doc="Symmetric stop.")


class Craft(Model):
    mass_kg: float = quantity("kg", gt=0.0, doc="Mass m.")
    cells: int = whole("", ge=1, le=12, default=4, doc="Cells of the battery.")
    span_m: float | None = quantity("m", lt=100.0, default=None, doc="Span.")
    name: str = Field(default="craft", min_length=1)
    mode: Literal["slow", "fast"] = "slow"
    spare: bool = Field(default=False, strict=True)
    wings: tuple[Wing, ...] = Field(default=(), max_length=2)
    factors: dict[SystemId, Annotated[float, quantity("", ge=0.0, doc="Factor.")]] = Field({})
    trim_deg: tuple[float, float] | None = None
    address: HostPort = "127.0.0.1:14550"

    @model_validator(mode="after")
    def _heavy_enough(self) -> "Craft":
        Problems.check(
            (("wings", i, "area_m2"), f"expected < {self.mass_kg} m^2, got {wing.area_m2}")
            for i, wing in enumerate(self.wings)
            if wing.area_m2 >= self.mass_kg
        )
        return self


def test_a_number_is_declared_with_names_or_in_order() -> None:
    """Plug-ins write either."""
    named = quantity("m", gt=0.0, le=9.0, default=2.0, doc="Span.")
    assert repr(quantity("m", "Span.", 2.0, gt=0.0, le=9.0)) == repr(named)
    assert repr(whole("", "Count.", 3, ge=1)) == repr(whole("", ge=1, default=3, doc="Count."))


def test_a_docstring_describes_the_keys() -> None:
    class Tail(Model):
        """A tail.

        Attributes:
            shape: Its shape, which may
                take two lines.
            span_m: Another text than the field's: the docstring counts.
        """

        shape: Literal["v", "t"] = "t"
        span_m: float = quantity("m", "Span.")
        area_m2: float = quantity("m^2", "Area.")
        name: str = Field(default="tail", description="Name.")

    said = {name: field.description for name, field in Tail.model_fields.items()}
    assert said == {
        "shape": "Its shape, which may take two lines.",
        "span_m": "Another text than the field's: the docstring counts.",
        "area_m2": "Area.",
        "name": "Name.",
    }


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "craft.yaml"


@pytest.fixture
def problems(file: Path) -> Callable[[str | bytes], list[str]]:
    def of(content: str | bytes) -> list[str]:
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(ConfigError) as caught:
            load(file, Craft)
        assert caught.value.path == file
        lines = zip(str(caught.value).splitlines(), caught.value.problems, strict=True)
        for line, problem in lines:
            assert re.fullmatch(rf"{re.escape(str(file))}(:\d+)*: {re.escape(str(problem))}", line)
        return list(map(str, caught.value.problems))

    return of


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("mass_kg: 30 in", "mass_kg: expected a number in kg, got '30 in'"),
        ("mass_kg: '30'", "mass_kg: expected a number in kg, got '30'"),
        ("mass_kg: true", "mass_kg: expected a number in kg, got true"),
        ("mass_kg:", "mass_kg: expected a number in kg, got nothing"),
        ("mass_kg: [1, 2]", "mass_kg: expected a number in kg, got a list of 2"),
        ("mass_kg: {a: 1}", "mass_kg: expected a number in kg, got a mapping"),
        ("mass_kg: 014", "mass_kg: expected a number in kg, got '014'"),
        ("mass_kg: -20.64", "mass_kg: expected > 0 kg, got -20.64"),
        ("mass_kg: 0", "mass_kg: expected > 0 kg, got 0"),
        ("mass_kg: .nan", "mass_kg: expected a finite number in kg, got nan"),
        ("mass_kg: .inf", "mass_kg: expected a finite number in kg, got inf"),
        ("mass_kg: 1e999", "mass_kg: expected a finite number in kg, got inf"),
        ("name: a", "mass_kg: missing; expected a number in kg"),
        ("mass_kg: 9\nspan_m: 100", "span_m: expected < 100 m, got 100"),
        ("mass_kg: 9\nspan_m: wide", "span_m: expected a number in m, got 'wide'"),
        ("mass_kg: 9\ncells: 4.0", "cells: expected a whole number, got 4.0"),
        ("mass_kg: 9\ncells: true", "cells: expected a whole number, got true"),
        ("mass_kg: 9\ncells: 13", "cells: expected [1, 12], got 13"),
        ("mass_kg: 9\nname: 3", "name: expected a text, got 3"),
        ("mass_kg: 9\nname: ''", "name: expected at least 1 character, got ''"),
        ("mass_kg: 9\nmode: quick", "mode: expected 'slow' or 'fast', got 'quick'"),
        ("mass_kg: 9\nspare: 1", "spare: expected true or false, got 1"),
        ("mass_kg: 9\nwings: 3", "wings: expected a list, got 3"),
        ("mass_kg: 9\nwings: [3]", "wings[0]: expected a mapping, got 3"),
        (
            "mass_kg: 9\nwings: [{area_m2: 1}, {area_m2: 1, limit_rad: 25}]",
            "wings[1].limit_rad: expected [0, 0.8] rad, got 25",
        ),
        ("mass_kg: 9\nwings: [{}]", "wings[0].area_m2: missing; expected a number in m^2"),
        (
            "mass_kg: 9\nwings: [{area_m2: 1}, {area_m2: 1}, {area_m2: 1}]",
            "wings: expected at most 2 entries, got a list of 3",
        ),
        ("mass_kg: 9\nfactors: {2: x}", "factors.2: expected a number, got 'x'"),
        ("mass_kg: 9\nfactors: {2: -1}", "factors.2: expected >= 0, got -1"),
        ("mass_kg: 9\nfactors: {251: 1}", "factors.251: expected [1, 250], got 251"),
        ("mass_kg: 9\nfactors: {x: 1}", "factors.x: expected a whole number, got 'x'"),
        ("mass_kg: 9\nfactors: 3", "factors: expected a mapping, got 3"),
        ("mass_kg: 9\ntrim_deg: [1]", "trim_deg[1]: missing; expected a number"),
        (
            "mass_kg: 9\naddress: here",
            "address: expected host:port with an IPv4 host and port 1-65535, got 'here'",
        ),
        ("mass_kg: 9\nmas_kg: 3", "mas_kg: unknown key; did you mean 'mass_kg'?"),
        ("mass_kg: 9\nmass_g: 3", "mass_g: unknown key; did you mean 'mass_kg'?"),
        (
            "mass_kg: 9\nwings: [{area_m2: 1, limit_deg: 3}]",
            "wings[0].limit_deg: unknown key; did you mean 'limit_rad'?",
        ),
        ("mass_kg: 9\nqqq: 3", "qqq: unknown key"),
        ("mass_kg: 9\n7: 3", "7: unknown key"),
        ("mass_kg: 1\nwings: [{area_m2: 2}]", "wings[0].area_m2: expected < 1.0 m^2, got 2.0"),
        ("", "the file is empty; expected a mapping"),
        ("# nothing\n", "the file is empty; expected a mapping"),
        ("- 1\n- 2\n", "expected a mapping, got a list of 2"),
        ("42", "expected a mapping, got 42"),
        (
            "mass_kg: 1\nmode: slow\nmass_kg: 2\n",
            "duplicate key 'mass_kg', given before in line 1",
        ),
        ("{a: 1, a: 2}", "duplicate key 'a', given before in line 1"),
        (
            "mass_kg: 1\n\tmode: slow\n",
            "not YAML: found a tab character that violates indentation",
        ),
        (
            "wings: [1, 2\nmass_kg: 1\n",
            "not YAML: did not find expected ',' or ']'",
        ),
        ("a: 1\n---\nb: 1\n", "not YAML: but found another document"),
        (
            "a: !!python/object:os.system 1",
            "not YAML: could not determine a constructor for the tag "
            "'tag:yaml.org,2002:python/object:os.system'",
        ),
        (b"mass_kg: 1 # \xfc\n", "not UTF-8 text: byte 13 is 0xfc"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(
    problems: Callable[[str | bytes], list[str]], text: str | bytes, problem: str
) -> None:
    assert problems(text) == [problem]


def test_every_problem_is_reported_at_once(
    problems: Callable[[str | bytes], list[str]],
) -> None:
    assert problems("mass_g: 3\ncells: x\nwings: [{area_m2: -1}, {area: 1}]\nspare: no\n") == [
        "mass_kg: missing; expected a number in kg",
        "cells: expected a whole number, got 'x'",
        "spare: expected true or false, got 'no'",
        "wings[0].area_m2: expected > 0 m^2, got -1",
        "wings[1].area_m2: missing; expected a number in m^2",
        "wings[1].area: unknown key; did you mean 'area_m2'?",
        "mass_g: unknown key; did you mean 'mass_kg'?",
    ]


def test_one_validator_can_report_several_problems(
    problems: Callable[[str | bytes], list[str]],
) -> None:
    assert problems("mass_kg: 1\nwings: [{area_m2: 2}, {area_m2: 3}]") == [
        "wings[0].area_m2: expected < 1.0 m^2, got 2.0",
        "wings[1].area_m2: expected < 1.0 m^2, got 3.0",
    ]


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path / "none.yaml", Craft)
    assert str(caught.value) == f"{tmp_path / 'none.yaml'}: no such file"


def test_folder_instead_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, Craft)
    assert str(caught.value) == f"{tmp_path}: expected a file, got a folder"


def test_nesting_beyond_reason(problems: Callable[[str | bytes], list[str]]) -> None:
    assert problems("[" * 5000) == ["not YAML: nested too deeply"]


def test_numbers_are_read_as_people_write_them(file: Path) -> None:
    for text, value in {"1e-3": 1e-3, "2": 2.0, "+1.5E+3": 1500.0, ".5": 0.5, "3.": 3.0}.items():
        file.write_text(f"mass_kg: {text}")
        assert load(file, Craft).mass_kg == value


def test_merged_mapping_may_override_its_anchor(file: Path) -> None:
    file.write_text(
        "mass_kg: 9\nwings:\n  - &w {area_m2: 1, limit_rad: 0.1}\n  - {<<: *w, area_m2: 2}\n"
    )
    assert load(file, Craft).wings == (
        Wing(area_m2=1, limit_rad=0.1),
        Wing(area_m2=2, limit_rad=0.1),
    )


@given(
    mass=st.floats(0.0, exclude_min=True, allow_infinity=False, allow_nan=False),
    name=st.text(st.characters(codec="utf-8"), min_size=1),
)
def test_what_is_dumped_loads_back_equal(
    tmp_path_factory: pytest.TempPathFactory, mass: float, name: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "dumped.yaml"
    craft = Craft(mass_kg=mass, name=name, factors={3: mass / 3.0}, trim_deg=(-0.0, 1 / 3))
    dump(craft, path)
    loaded = load(path, Craft)
    assert loaded == craft
    assert loaded.trim_deg is not None
    assert math.copysign(1.0, loaded.trim_deg[0]) == -1.0


@pytest.mark.parametrize(
    "name", ["1e5", "014", "0x1F", "true", "yes", "~", "1.5", "null", "<<", "\x85", "a\n b"]
)
def test_text_that_looks_like_something_else_stays_text(file: Path, name: str) -> None:
    craft = Craft(mass_kg=1.0, name=name)
    dump(craft, file)
    assert load(file, Craft) == craft


def test_models_are_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Craft(mass_kg=1.0).mass_kg = 2.0  # type: ignore[misc]  # it is frozen


def test_declaration_can_be_read_back() -> None:
    declared = describe(Wing.model_fields["limit_rad"])
    assert declared == Quantity("rad", None, 0.0, None, 0.8, "Symmetric stop.")
    assert declared.range() == "[0, 0.8] rad"
    assert describe(Craft.model_fields["name"]) is None


@pytest.mark.parametrize(
    ("count", "noun", "text"),
    [
        (0, "item", "0 items"),
        (1, "item", "1 item"),
        (2.5, "turn", "2.5 turns"),
        (2, "entry", "2 entries"),
    ],
)
def test_things_are_counted_with_their_noun(count: float, noun: str, text: str) -> None:
    assert counted(count, noun) == text


@pytest.mark.parametrize("unit", ["deg", "m_s", "s", "deg_s"])
@pytest.mark.parametrize("name", ["b2", "k", "rate_limit"])
def test_a_name_without_its_unit_is_suggested_with_it(name: str, unit: str) -> None:
    known = ["mode", "b1_deg", f"{name}_{unit}", "kind", "bias_n", "rate"]
    assert f"did you mean '{name}_{unit}'?" in unknown_key(("trigger", name), known).text


def test_a_union_without_its_kind_names_the_kinds(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("shape: {size: 1}")
    with pytest.raises(ConfigError, match=r"shape.kind: missing; expected one of 'a', 'b'"):
        load(file, Shaped)


class KindA(Model):
    kind: Literal["a"]
    size: int


class KindB(Model):
    kind: Literal["b"]
    size: int


class Shaped(Model):
    shape: Annotated[KindA | KindB, Field(discriminator="kind")]

"""Configuration files: YAML to checked models and back.

A file that cannot be used is refused with every problem at once, one line each, which names
the line, the key, its value, and what was expected with its unit::

    wing.yaml:4: aircraft.mass_g: unknown key; did you mean 'mass_kg'?
    wing.yaml:3: aircraft.mass_kg: missing; expected a number in kg
    wing.yaml:9: uavs[1].initial.airspeed_m_s: expected > 0 m/s, got -40

`read` and `validate` are the two halves of `load`, for callers that change the tree
in between.
"""

import types
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, RootModel, Tag, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from mavlink_defs.config.models import (
    ConfigError,
    Loc,
    Problem,
    Problems,
    counted,
    shown,
    unknown_key,
)
from mavlink_defs.config.output_files import write_text
from mavlink_defs.config.quantity import describe
from mavlink_defs.config.user_files import read_text
from mavlink_defs.config.written import located
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of, yaml_problem

M = TypeVar("M", bound=BaseModel)


def load(path: Path | str, model: type[M]) -> M:
    """Read a YAML file and check it.

    Raises:
        ConfigError: The file cannot be read, or is not what the model asks for.
    """
    return validate(path, read(path), model)


def read(path: Path | str, *, quoting: bool = True) -> dict[Any, Any]:
    """Read a YAML file that holds a mapping, as plain data.

    Args:
        path: The file.
        quoting: Errors may quote the file.

    Raises:
        ConfigError: The file cannot be read, is not YAML, or holds something else.
    """
    return parse(path, read_text(path), quoting=quoting)


def parse(path: Path | str, text: str, *, quoting: bool = True) -> dict[Any, Any]:
    """Read YAML that holds a mapping, as plain data; `path` names its origin in errors.

    Args:
        path: Origin of the text.
        text: The text.
        quoting: Errors may quote it.

    Raises:
        ConfigError: It is not YAML, or holds something else.
    """
    try:
        data = parse_yaml(text, str(path))
    except (yaml.YAMLError, RecursionError, ValueError) as exc:
        place, what = yaml_problem(exc)
        problem = Problem((), what if quoting else "not YAML", source=f"{path}{place}")
        raise ConfigError(path, [problem]) from exc
    if data is None:
        raise ConfigError(path, [Problem((), "the file is empty; expected a mapping")])
    if not isinstance(data, dict):
        got = shown(data) if quoting and not isinstance(data, str) else "something else"
        raise ConfigError(path, [Problem((), f"expected a mapping, got {got}")])
    return data


def validate(path: Path | str, data: dict[Any, Any], model: type[M]) -> M:
    """Check plain data that came from a file.

    Raises:
        ConfigError: The data is not what the model asks for.
    """
    try:
        return model.model_validate(data)
    except ValidationError as exc:
        problems = located(data, problems_of(model, exc))
    raise ConfigError(path, problems)


def problems_of(model: type[BaseModel], exc: ValidationError) -> list[Problem]:
    """Return what pydantic found wrong with the data of a model, as our own problems."""
    errors = exc.errors(include_url=False)
    return [problem for error in errors for problem in _problems(model, error)]


def dump(model: BaseModel, path: Path | str) -> None:
    """Write a model as YAML that loads back to an equal one, floats to the last bit."""
    text = yaml_of(model.model_dump())
    write_text(Path(path), text)


# translation of pydantic's errors to `Problem`


def _problems(model: type[BaseModel], error: ErrorDetails) -> list[Problem]:
    cause = error.get("ctx", {}).get("error")
    if isinstance(cause, Problems):
        return [
            problem._replace(loc=_Place(model, error["loc"] + problem.loc).loc)
            for problem in cause.problems
        ]
    if error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]:
        return []  # pydantic does not count entries that have problems of their own
    place = _Place(model, error["loc"])
    if error["type"] == "union_tag_not_found" and isinstance(error["input"], dict):
        key = error["ctx"]["discriminator"].strip("_()'")
        return [Problem((*place.loc, key), "missing" + place.tags())]
    if error["type"] == "union_tag_invalid":
        tags, tag = error["ctx"]["expected_tags"], shown(error["ctx"]["tag"])
        key = error["ctx"]["discriminator"].strip("_()'")  # the key 'kind', or a function _kind()
        return [Problem((*place.loc, key), f"expected one of {tags}, got {tag}")]
    if error["type"] in {"extra_forbidden", "invalid_key"}:
        whole_file = ["extends"] if len(place.loc) == 1 else []  # see `inherit`
        return [unknown_key(place.loc, [*place.siblings, *whole_file])]
    return [Problem(place.loc, _text(place, error))]


def _text(place: "_Place", error: ErrorDetails) -> str:
    kind, got = error["type"], shown(error["input"])
    declared = place.field and describe(place.field)
    if kind == "missing":
        return f"missing; expected {place.expected}"
    if kind == "value_error":
        return str(error["ctx"]["error"])
    if kind == "finite_number":
        return f"expected {place.expected.replace('a number', 'a finite number')}, got {got}"
    if kind in {"greater_than", "greater_than_equal", "less_than", "less_than_equal"} and declared:
        return f"expected {declared.range()}, got {got}"
    if kind in {"too_short", "too_long", "string_too_short", "string_too_long"}:
        word = "entry" if kind.startswith("too") else "character"
        bound = error["ctx"].get("min_length", error["ctx"].get("max_length"))
        which = "at least" if kind.endswith("short") else "at most"
        return f"expected {which} {counted(int(bound or 0), word)}, got {got}"
    return f"expected {place.expected}, got {got}"


class _Place:
    """The declaration that the models make for one place.

    Attributes:
        loc: The place as the file has it: without pydantic's tags, only indices of lists are int.
        field: The declaration of the value that is expected there, if known.
        siblings: Keys that the mapping around it may have.
        expected: What is expected there, as a text.
    """

    def __init__(self, model: type[BaseModel], loc: Loc) -> None:
        self.loc: Loc = ()
        self.field: FieldInfo | None = None
        self.siblings: list[str] = []
        self._type: Any = model
        self._key: Any = None
        for part in loc:
            self._descend(part)
        self._strip()
        self.expected = _expected(self._type, self.field)

    def _descend(self, part: str | int) -> None:
        self._strip()
        here, self.siblings = self._type, []
        if get_origin(here) in {Union, types.UnionType}:
            chosen = [member for member in get_args(here) if part in _tags(member)]
            if chosen:  # pydantic puts the tag of a union's member into the location
                self._type = chosen[0]
                return
        if part == "[key]":  # pydantic's mark for a problem of the key, not of the value
            self._type = self._key
            return
        if isinstance(here, type) and issubclass(here, BaseModel):
            self.siblings = list(here.model_fields)
            self.field = here.model_fields.get(str(part))
            self._type = self.field.annotation if self.field else None
            self.loc += (str(part),)
            return
        origin, inner = get_origin(here), get_args(here)
        if origin is tuple and isinstance(part, int) and ... not in inner and part < len(inner):
            self._type = inner[part]
        elif origin is dict:
            self._key, self._type = inner
        else:
            self._type = inner[0] if inner else None
        self.loc += (str(part) if origin is dict else part,)

    def tags(self) -> str:
        """Return what selects a member of the union that is expected there, as a text."""
        tags = [repr(tag) for member in _members(self._type) for tag in _tags(member)]
        return f"; expected one of {', '.join(tags)}" if tags else ""

    def _strip(self) -> None:
        """Take optionality, annotations and root models off the type."""
        while True:
            here = self._type
            if get_origin(here) is Annotated:
                self._type, *metadata = get_args(here)
                self.field = next((m for m in metadata if isinstance(m, FieldInfo)), self.field)
            elif isinstance(here, type) and issubclass(here, RootModel):
                self._type = here.model_fields["root"].annotation
            elif len(members := _members(here)) == 1 and members[0] is not here:
                self._type = members[0]
            else:
                return


def _members(annotation: Any) -> list[Any]:
    if get_origin(annotation) in {Union, types.UnionType}:
        return [member for member in get_args(annotation) if member is not types.NoneType]
    return [annotation]


def _tags(member: Any) -> Sequence[object]:
    """Return the tags by which a tagged union, or one with `kind`, selects this member."""
    if get_origin(member) is Annotated:
        return [m.tag for m in get_args(member) if isinstance(m, Tag)]
    kind = getattr(member, "model_fields", {}).get("kind")
    return get_args(kind.annotation) if kind else ()


def _expected(annotation: Any, field: FieldInfo | None) -> str:
    if get_origin(annotation) in {Union, types.UnionType}:
        places = [_strip_annotated(member) for member in _members(annotation)]
        texts = (_expected(inner, found or field) for inner, found in places)
        return " or ".join(dict.fromkeys(texts))
    if get_origin(annotation) is Literal:
        *first, last = map(repr, get_args(annotation))
        return f"{', '.join(first)} or {last}" if first else last
    kind = get_origin(annotation) or annotation
    declared = field and describe(field)
    unit = f" in {declared.unit}" if declared and declared.unit else ""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return "a mapping"
    return {
        bool: "true or false",
        int: f"a whole number{unit}",
        float: f"a number{unit}",
        str: "a text",
        dict: "a mapping",
        list: "a list",
        tuple: "a list",
    }.get(kind, "something else")


def _strip_annotated(annotation: Any) -> tuple[Any, FieldInfo | None]:
    if get_origin(annotation) is not Annotated:
        return annotation, None
    inner, *metadata = get_args(annotation)
    return inner, next((m for m in metadata if isinstance(m, FieldInfo)), None)

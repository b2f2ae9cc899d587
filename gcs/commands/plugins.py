"""What `gcs laws`, `gcs triggers` and `gcs guidance` print: a list, one of it, a C header."""

import difflib
from collections.abc import Callable, Iterator
from importlib.metadata import version
from inspect import cleandoc
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

import numpy as np
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from rich.table import Column

import ftc_autopilot.plugins
from ftc_autopilot.common.schedule import Schedule
from ftc_autopilot.plugins import loading
from ftc_autopilot.plugins.functions import way_of
from gcs.console.errors import BadInput
from gcs.console.lines import print_json, print_line
from gcs.console.stopping import running_code
from gcs.console.terminal import console_of, table_of, texts
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import describe
from mavlink_defs.runtime.foreign import PluginError

_OURS = "ftc-sitl"


class PluginKind(NamedTuple):
    """Laws, triggers or guidance laws."""

    noun: str
    header: str
    group: str
    own: dict[str, type[Model]]
    load: Callable[[str], type[Model]]
    base: type[Model]
    parameters: Callable[[type[Any]], np.dtype]


class _Listed(NamedTuple):
    name: str
    package: str
    written: str
    summary: str


def show_list(kind: PluginKind, *, as_json: bool) -> None:
    """Print the names of ours and of those that packages register."""
    listed = list(_listed(kind))
    if as_json:
        print_json([one._asdict() for one in listed], indent=2)
        return
    table = table_of(
        texts(kind.noun),
        texts("package"),
        texts("written in"),
        texts("what it is, and when to choose it"),
    )
    for one in listed:
        table.add_row(*one)
    console_of(stderr=False).print(table)
    print_line(f"and any other by its file: {_key(kind)}: FILE.py:CLASS")


def _listed(kind: PluginKind) -> Iterator[_Listed]:
    ours = f"{_OURS} {version(_OURS)}"
    for name, model in kind.own.items():
        yield _Listed(name, ours, "compiled Python", _summary(model))
    for name, point in sorted(loading.registered(kind.group).items()):
        package = "" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        try:
            if name in kind.own:
                loading.check_shadowed(kind.group, name)
            model = kind.load(name)
            yield _Listed(name, package, way_of(model), _summary(model))
        except PluginError as problem:
            yield _Listed(name, package, "", f"cannot be used: {problem}")


def _summary(model: type[Model]) -> str:
    """Return what a class says first of itself: what it is, and when to choose it."""
    paragraphs = cleandoc(model.__doc__ or "its class has no text").split("\n\n")
    return " ".join(" ".join(paragraphs[:2]).split())


def _key(kind: PluginKind) -> str:
    return "kind" if "kind" in kind.base.model_fields else "mode"


def found(kind: PluginKind, name: str) -> type[Model]:
    """Return the model of a name: one of ours, an entry point's, or FILE.py:CLASS.

    Raises:
        BadInput: There is none, or it cannot be used.
    """
    if name in kind.own:
        return kind.own[name]
    if not loading.is_by_file(name) and name not in loading.registered(kind.group):
        known = [*kind.own, *loading.registered(kind.group)]
        close = difflib.get_close_matches(name, known, n=1)
        meant = f"; did you mean {close[0]!r}?" if close else ""
        raise BadInput(
            f"there is no {kind.noun} {name!r}{meant}",
            f"expected one of {', '.join(known)}, or FILE.py:CLASS",
        )
    try:
        with loading.watching(running_code):
            return kind.load(loading.resolved(name, Path.cwd()))
    except PluginError as problem:
        raise BadInput(str(problem)) from problem


def show(kind: PluginKind, name: str) -> None:
    """Print where one comes from, its text, and its keys."""
    model = found(kind, name)
    plugin = loading.plugin_of(model)
    if plugin is None:
        print_line(f"{name}: a {kind.noun} of {_OURS} {version(_OURS)}")
    else:
        package = plugin.package or str(plugin.file)
        print_line(f"{name}: {way_of(model)}, of {package}, code {plugin.digest}")
    text, _, _ = cleandoc(model.__doc__ or "its class has no text").partition("\n\nAttributes:\n")
    print_line(f"\n{text}\n")
    if page := vars(model).get("PAGE"):
        print_line(f"More: {page}{' of the documentation' if plugin is None else ''}\n")
    table = table_of(
        Column("key", no_wrap=True), texts("default"), texts("expected"), texts("meaning")
    )
    for key, field in model.model_fields.items():
        if key not in kind.base.model_fields:
            declared = _declared(field.annotation, field)
            unit = "" if declared is None else declared.range()
            table.add_row(
                key, _default(field), unit, field.description or getattr(declared, "doc", "")
            )
    console_of(stderr=False).print(table)
    further = ", ".join(name for name in kind.base.model_fields if name != _key(kind))
    print_line(f"and the keys of every {kind.noun}: {further}")


def _declared(annotation: Any, field: FieldInfo | None = None) -> Any:
    """Return the declaration of a number: of a field, or of the numbers that it consists of."""
    if field is not None and (declared := describe(field)) is not None:
        return declared
    for metadata in getattr(annotation, "__metadata__", ()):
        if isinstance(metadata, FieldInfo) and (declared := describe(metadata)) is not None:
            return declared
    if isinstance(annotation, type) and issubclass(annotation, Schedule):
        return _declared(annotation.__pydantic_generic_metadata__["args"][0])
    inner = get_args(annotation) if get_origin(annotation) is tuple else ()
    return _declared(inner[0]) if inner else None


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required"
    value = field.default
    return "mapping" if isinstance(value, Model) else str(value)


def _class_of(kind: PluginKind, name: str) -> type[Model]:
    """Return the model of a name, whose library may not be built yet."""
    if name in kind.own or not loading.is_by_file(name):
        return found(kind, name)
    try:
        with loading.watching(running_code):
            return loading.class_of(loading.resolved(name, Path.cwd()), kind.group, kind.base)[0]
    except PluginError as problem:
        raise BadInput(str(problem)) from problem


def show_header(kind: PluginKind, name: str | None, *, folder: bool) -> None:
    """Print parameters and state of one as C structs, or the folder of our headers.

    Raises:
        BadInput: Not just one of both is asked for, or there is no such plug-in.
    """
    if folder == (name is not None):
        raise BadInput(f"expected either a {kind.noun} or --folder")
    if name is None:
        print_line(str(Path(ftc_autopilot.plugins.__file__).parent))
        return
    model: Any = _class_of(kind, name)
    print_line(f'#include "{kind.header}"\n')
    print_line(_struct("parameters", kind.parameters(model)))
    print_line(_struct("state", model.STATE))


def _struct(name: str, dtype: np.dtype) -> str:
    lines = "\n".join(_members(dtype, "    "))
    return f"struct {name} {{\n{lines}\n}};\n" if lines else f"/* no {name} */\n"


_C = {"f8": "double", "f4": "float", "i8": "int64_t", "i4": "int32_t", "u1": "uint8_t"}


def _members(dtype: np.dtype, indent: str) -> Iterator[str]:
    for name in dtype.names or ():
        one = dtype[name]
        sizes = "".join(f"[{size}]" for size in one.shape)
        if one.base.names:
            yield f"{indent}struct {{"
            yield from _members(one.base, f"{indent}    ")
            yield f"{indent}}} {name}{sizes};"
        else:
            yield f"{indent}{_C[one.base.str[1:]]} {name}{sizes};"

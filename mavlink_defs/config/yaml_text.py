"""YAML as configuration files have it, read and written without loss.

Plain scalars follow YAML 1.2's core schema: 1e-3 is a number, yes is a text. A mapping must not
have a key twice.
"""

import re
from typing import Any

import yaml

__all__ = ["parse_yaml", "yaml_of", "yaml_problem"]


def parse_yaml(text: str) -> Any:
    """Return the plain data in a text.

    Raises:
        yaml.YAMLError, RecursionError, ValueError: It is not YAML; see `yaml_problem`.
    """
    return yaml.load(text, _Loader)


def yaml_of(data: Any) -> str:
    """Return a text that `parse_yaml` reads back as equal data, floats to the last bit."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)


def yaml_problem(exc: Exception) -> str:
    """Return what is wrong with a text that `parse_yaml` refused."""
    if isinstance(exc, yaml.MarkedYAMLError) and exc.problem_mark is not None:
        mark = exc.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: "
        text = exc.problem or "cannot be understood"
        return where + (text if text.startswith("duplicate key") else f"not YAML: {text}")
    if isinstance(exc, RecursionError):
        return "not YAML: nested too deeply"
    return f"not YAML: {' '.join(str(exc).split())}"


class _Loader(yaml.SafeLoader):
    """Plain scalars as in YAML 1.2's core schema (1e-3 is a number); keys occur once."""

    yaml_implicit_resolvers = {}  # noqa: RUF012 - PyYAML's way; it is copied, not shared

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # refused later: no key of ours is a list or a mapping
            if key.value in seen:
                problem = f"duplicate key '{key.value}', given before in line {seen[key.value]}"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen[key.value] = key.start_mark.line + 1
        return node


class _Dumper(yaml.SafeDumper):
    """Quotes whatever `_Loader` would not read back as text."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_str(self, data: str) -> Any:
        style = None if data.isprintable() else '"'  # PyYAML's other styles lose U+0085
        return self.represent_scalar("tag:yaml.org,2002:str", data, style)


_Dumper.add_representer(str, _Dumper.represent_str)


_SCALARS = {  # tag: pattern, characters that it can begin with
    "bool": (r"true|True|TRUE|false|False|FALSE", [*"tTfF"]),
    "int": (r"[-+]?(?:0|[1-9][0-9]*)", [*"-+0123456789"]),
    "float": (
        r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        [*"-+.0123456789"],
    ),
    "null": (r"~|null|Null|NULL|", [*"~nN", ""]),
    "merge": (r"<<", ["<"]),
}
for _tag, (_pattern, _first) in _SCALARS.items():
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(
            f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first
        )

"""YAML as configuration files have it, read and written without loss.

Plain scalars follow YAML 1.2's core schema: 1e-3 is a number, yes is a text. A mapping must not
have a key twice. libyaml reads the text; its events become data here, as libyaml's own composer
has no end of its recursion. ruamel.yaml takes seven times as long for a large mission.
"""

import functools
import re
from typing import Any

import yaml
from yaml.composer import Composer

from mavlink_defs.config.written import WrittenDict, WrittenList
from mavlink_defs.visible import visible_lines

_MAX_VALUES = 1_000_000
"""Values that a text may stand for: aliases of aliases multiply without end."""


_KEPT_TEXT = 20_000
"""Length of a text that is too long to be kept."""


class DuplicateKeyError(yaml.MarkedYAMLError):
    """A mapping has a key twice."""


def parse_yaml(text: str, name: str = "") -> Any:
    """Return the plain data in a text, with where it is written if the text has a name.

    Raises:
        yaml.YAMLError, RecursionError, ValueError: It is not YAML; see `yaml_problem`.
    """
    return _copied(_kept(text, name)) if len(text) < _KEPT_TEXT else _parsed(text, name)


def _parsed(text: str, name: str) -> Any:
    loader = _Loader(text, name)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


_kept = functools.lru_cache(_parsed)  # a campaign reads the same files for each of its flights


def _copied(data: Any) -> Any:
    """Return the same data, which a caller may change."""
    if isinstance(data, WrittenDict):
        inner = {key: _copied(value) for key, value in data.items()}
        return WrittenDict(inner, dict(data.sources))
    if isinstance(data, WrittenList):
        return WrittenList(map(_copied, data), dict(data.sources))
    return data


def yaml_of(data: Any) -> str:
    """Return a text that `parse_yaml` reads back as equal data, floats to the last bit.

    Control characters are escapes in it, format characters (U+202E) too, which YAML permits.
    """
    text = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return visible_lines(text)


def yaml_problem(exc: Exception) -> tuple[str, str]:
    """Return where a text is wrong that `parse_yaml` refused, as ":3:1" or "", and what is."""
    if isinstance(exc, yaml.MarkedYAMLError) and exc.problem_mark is not None:
        mark = exc.problem_mark
        text = exc.problem or "cannot be understood"
        what = text if isinstance(exc, DuplicateKeyError) else f"not YAML: {text}"
        return f":{mark.line + 1}:{mark.column + 1}", what
    if isinstance(exc, RecursionError):
        return "", "not YAML: nested too deeply"
    return "", f"not YAML: {' '.join(str(exc).split())}"


if yaml.__with_libyaml__:

    class _Composing(Composer, yaml.CSafeLoader):
        """Composes what libyaml reads."""

        def __init__(self, text: str) -> None:
            yaml.CSafeLoader.__init__(self, text)
            Composer.__init__(self)

else:  # where PyYAML has no wheel for a new Python, and no libyaml was there when pip built it
    _Composing = yaml.SafeLoader  # type: ignore[misc, assignment]  # reads the same, in more time


class _Loader(_Composing):
    """Plain scalars as in YAML 1.2's core schema (1e-3 is a number); keys occur once."""

    yaml_implicit_resolvers = {}  # noqa: RUF012 - PyYAML's way; it is copied, not shared

    def __init__(self, text: str, name: str) -> None:
        super().__init__(text)
        self._name = name
        self._values = 0  # composed so far, each as often as aliases repeat it
        self._sizes: dict[yaml.Node, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        event: Any = self.peek_event()
        begin: Any = event.start_mark
        before = self._values
        self._values += 1
        node: Any = super().compose_node(parent, index)
        if not isinstance(event, yaml.AliasEvent):
            self._sizes[node] = self._values - before
        elif node not in self._sizes:
            problem = "alias of what it is in"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=begin)
        else:
            self._values += self._sizes[node]
        if self._values > _MAX_VALUES:
            problem = f"its aliases repeat more than {_MAX_VALUES} values"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=begin)
        return node

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # refused later: no key of ours is a list or a mapping
            if key.value in seen:
                problem = f"duplicate key '{key.value}', given before in line {seen[key.value]}"
                raise DuplicateKeyError(problem=problem, problem_mark=key.start_mark)
            seen[key.value] = key.start_mark.line + 1
        return node

    def construct_written_map(self, node: Any) -> Any:
        data = WrittenDict()
        yield data
        data.update(self.construct_mapping(node))
        for key, _ in node.value:
            data.sources[self.construct_object(key)] = self._source(key)

    def construct_written_seq(self, node: Any) -> Any:
        data = WrittenList()
        yield data
        data.extend(self.construct_sequence(node))
        data.sources = {i: self._source(entry) for i, entry in enumerate(node.value)}

    def _source(self, node: Any) -> str:
        return f"{self._name}:{node.start_mark.line + 1}" if self._name else ""


_add: Any = _Loader.add_constructor  # its stub knows no such loader
_add("tag:yaml.org,2002:map", _Loader.construct_written_map)
_add("tag:yaml.org,2002:seq", _Loader.construct_written_seq)


class _Dumper(yaml.SafeDumper):
    """Quotes whatever `_Loader` would not read back as text."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_str(self, data: str) -> Any:
        style = None if data.isprintable() else '"'  # PyYAML's other styles lose U+0085
        return self.represent_scalar("tag:yaml.org,2002:str", data, style)


_Dumper.add_representer(str, _Dumper.represent_str)
_Dumper.add_representer(WrittenDict, _Dumper.represent_dict)
_Dumper.add_representer(WrittenList, _Dumper.represent_list)


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

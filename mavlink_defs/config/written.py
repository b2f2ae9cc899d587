"""Plain data that remembers where each of its values is written.

It is a dict or a list like any other; what a program puts into one has no source.
"""

from collections.abc import Iterable
from typing import Any

from mavlink_defs.config.problems import Loc, Problem


class WrittenDict(dict[Any, Any]):
    """A mapping.

    Attributes:
        sources: Where each key is written, such as "wing.yaml:12".
    """

    sources: dict[Any, str]

    def __init__(self, content: Any = (), sources: dict[Any, str] | None = None) -> None:
        super().__init__(content)
        self.sources = sources or {}


class WrittenList(list[Any]):
    """A list.

    Attributes:
        sources: Where each entry is written, by its index.
    """

    sources: dict[Any, str]

    def __init__(self, content: Iterable[Any] = (), sources: dict[Any, str] | None = None) -> None:
        super().__init__(content)
        self.sources = sources or {}


Written = WrittenDict | WrittenList


def written_in(value: Any, source: str) -> Any:
    """Return a tree all of which is written in one place."""
    if isinstance(value, dict):
        inner = {key: written_in(part, source) for key, part in value.items()}
        return WrittenDict(inner, dict.fromkeys(inner, source))
    if isinstance(value, list):
        parts = [written_in(part, source) for part in value]
        return WrittenList(parts, dict.fromkeys(range(len(parts)), source))
    return value


def source_at(tree: Any, loc: Loc) -> str:
    """Return where a value is written, or what should hold it; "" if that is unknown."""
    source = ""
    for part in loc:
        if isinstance(tree, dict):
            number = int(part) if isinstance(part, str) and part.isdecimal() else part
            keys = [key for key in (part, number) if key in tree]
        else:
            keys = [part] if isinstance(tree, list) and part in range(len(tree)) else []
        if not keys:
            break
        if isinstance(tree, Written):
            source = tree.sources.get(keys[0], "")
        tree = tree[keys[0]]
    return source


def located(tree: Any, problems: Iterable[Problem]) -> list[Problem]:
    """Return problems of a tree, each with where its value is written."""
    return [p if p.source else p._replace(source=source_at(tree, p.loc)) for p in problems]

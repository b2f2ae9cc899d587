"""The problems that are found in configurations and other files of the user.

Errors: ValueError ← ConfigError (a file), Problems (inside a validator).
"""

import difflib
import enum
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from mavlink_defs.visible import visible

_MAX_SHOWN = 100
"""Problems of one file that an error lists; further ones are counted."""

Loc: TypeAlias = tuple[str | int, ...]
"""Location of a value: keys and list indices from the outside in."""


class ProblemKind(enum.Enum):
    """Kind of problem."""

    VALUE = enum.auto()
    UNKNOWN_KEY = enum.auto()


class Problem(NamedTuple):
    """One thing wrong with a configuration; as a text, one line that begins with the place.

    Two are equal that say the same of the same place, wherever its value is written.

    Attributes:
        loc: Where it is: keys and list indices from the outside in; empty for the whole.
        text: What is wrong. With `keys`, a format string that names them as {0}, {1} and so on.
        kind: Kind of the problem.
        keys: Other keys of the same mapping that the text names.
        source: Where the value is written, such as "wing.yaml:12"; empty if that is unknown.
    """

    loc: Loc
    text: str
    kind: ProblemKind = ProblemKind.VALUE
    keys: tuple[str, ...] = ()
    source: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Problem) and self[:-1] == other[:-1]

    def __hash__(self) -> int:
        return hash(self[:-1])

    def __str__(self) -> str:
        return self.line({})

    def line(self, names: Mapping[str, str]) -> str:
        """Return the line with other names for some of the keys.

        Args:
            names: From keys to names, such as command-line options.
        """
        text, place = self.text, ""
        if self.keys:
            text = text.format(*(names.get(key, key) for key in self.keys))
        for part in self.loc:
            place += f"[{part}]" if isinstance(part, int) else f".{names.get(part, part)}"
        return visible(f"{place.removeprefix('.')}: {text}" if place else text)


class ConfigError(ValueError):
    """The file cannot be used; `problems` holds each thing wrong with it."""

    def __init__(self, path: Path | str, problems: Iterable[Problem]) -> None:
        self.path, self.problems = Path(path), list(problems)
        super().__init__(self.path, self.problems)

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @property
    def lines(self) -> list[str]:
        """Each problem in a line, after the place where its value is written, or the file."""
        path = visible(str(self.path))
        lines = [f"{visible(p.source) or path}: {p}" for p in self.problems[:_MAX_SHOWN]]
        more = len(self.problems) - _MAX_SHOWN
        return [*lines, f"{path}: and {counted(more, 'more problem')}"] if more > 0 else lines


class Problems(ValueError):  # noqa: N818 - several errors in one
    """Raised by a model's validator for everything it found, with places below that model.

    A problem that is a value's may be given as its place and text only.
    """

    def __init__(self, problems: Iterable[Problem | tuple[Loc, str]]) -> None:
        self.problems = [Problem(*problem) for problem in problems]
        super().__init__("; ".join(map(str, self.problems)))

    @classmethod
    def check(cls, problems: Iterable[Problem | tuple[Loc, str]]) -> None:
        """Raise all problems, if there are any."""
        found = cls(problems)
        if found.problems:
            raise found


def unknown_key(loc: Loc, known: Iterable[str]) -> Problem:
    """Return the problem that a key is unknown; it names the known one probably meant.

    A name without its unit, as b2 for b2_deg, is the likeliest slip.
    """
    key, names = loc[-1], list(known)
    begun = [name for name in names if name.startswith(f"{key}_")]
    close = begun if len(begun) == 1 else difflib.get_close_matches(str(key), names, n=1)
    parts = {part for part in str(key).split("_") if len(part) > 2}
    alike = close or [name for name in names if parts & set(name.split("_"))]
    text = f"unknown key; did you mean '{alike[0]}'?" if alike else "unknown key"
    return Problem(loc, text, ProblemKind.UNKNOWN_KEY)


def repeated(values: Sequence[object]) -> list[tuple[int, str]]:
    """Return index and problem of each value that occurs in a list for the second time."""
    first: dict[object, int] = {}
    return [
        (i, f"expected each only once, got {shown(value)} again")
        for i, value in enumerate(values)
        if first.setdefault(value, i) != i
    ]


def counted(count: float, noun: str) -> str:
    """Return a number of things as a text shows it: "1 entry", "2 entries"."""
    several = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    number = f"{count:g}" if isinstance(count, float) else str(count)
    return f"{number} {noun if count == 1 else several}"


def shown(value: object) -> str:
    """Return a value as an error message shows it."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case dict():
            return "a mapping"
        case list() | tuple():
            return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."

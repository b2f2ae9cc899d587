"""Which column of somebody's table is which quantity: a small YAML file."""

from collections.abc import Collection, Iterator
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from gcs.results.logs.names import UNITS, factor, units_into
from gcs.results.logs.table import LogChannel, channel
from mavlink_defs.config.files import load
from mavlink_defs.config.models import Model, Problems, Title
from mavlink_defs.config.problems import Loc, unknown_key

_MAPS = resources.files("gcs.results.logs") / "maps"


class MappedColumn(Model):
    """A column: ours = sign * scale * (value in ours for unit) + offset.

    Attributes:
        column: Its name in the table.
        unit: Unit of its values; ours if left out.
        scale: Factor besides the unit's.
        sign: -1: it counts the other way round.
        offset: Added at last, in our unit.
        optional: Whether tables without it are of this kind, too.
    """

    column: Title = Field(min_length=1)
    unit: Title | None = None
    scale: float = Field(1.0, gt=0.0)
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    optional: bool = False

    def channel(
        self, name: str, time_s: np.ndarray, values: np.ndarray, clock: str
    ) -> LogChannel | None:
        """Return the channel that values of the column make; None of no number."""
        scale = self.sign * self.scale * (factor(self.unit or UNITS[name], UNITS[name]) or 1.0)
        return channel(name, time_s, scale * values + self.offset, self.column, clock)


class TimeColumn(Model):
    """The column of time.

    Attributes:
        column: Its name in the table.
        unit: Of numbers; not of dates.
    """

    column: Title = Field(min_length=1)
    unit: Literal["s", "ms", "us", "ns"] = "s"


class ColumnMap(Model):
    """Which columns of a table are read, as what.

    Attributes:
        title: What tables it is of.
        source: Where such tables are, and their licence.
    """

    title: Title = ""
    source: Title = ""
    time: TimeColumn
    channels: Annotated[dict[str, MappedColumn], Field(min_length=1)]

    @field_validator("channels", mode="after")
    @classmethod
    def _known(cls, channels: dict[str, MappedColumn]) -> dict[str, MappedColumn]:
        Problems.check(_problems(channels))
        return channels

    @model_validator(mode="after")
    def _reads_something(self) -> "ColumnMap":
        if all(one.optional for one in self.channels.values()):
            raise ValueError("expected a channel that is not optional")
        return self

    def fits(self, columns: Collection[str]) -> bool:
        """Return whether a table has all that is not optional."""
        return not self.missing(columns)

    def missing(self, columns: Collection[str]) -> list[str]:
        """Return the columns that a table should have and has not."""
        needed = [one.column for one in self.channels.values() if not one.optional]
        return [name for name in (self.time.column, *needed) if name not in columns]


def _problems(channels: dict[str, MappedColumn]) -> Iterator[tuple[Loc, str]]:
    for name, one in channels.items():
        if name not in UNITS:
            yield (name,), unknown_key((name,), UNITS).text
        elif one.unit is not None and factor(one.unit, UNITS[name]) is None:
            expected = ", ".join(map(repr, units_into(UNITS[name])))
            yield (name, "unit"), f"expected one of {expected}, got {one.unit!r}"


def read_map(path: Path) -> ColumnMap:
    """Read a column map; ConfigError, with every problem, if it is none."""
    return load(path, ColumnMap)


def bundled_maps() -> Iterator[ColumnMap]:
    """Yield the maps that come with the program."""
    for entry in sorted(_MAPS.iterdir(), key=lambda one: one.name):
        if entry.name.endswith(".yaml"):
            with resources.as_file(entry) as path:
                yield read_map(path)

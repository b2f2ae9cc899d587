"""The flights of a campaign by variant, as arrays for statistics."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcs.campaigns.outcomes import happened
from gcs.campaigns.store import read_results, result_columns
from gcs.errors import BadInput

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["Sample", "figures_of", "higher_is_better", "read_samples", "same_draws", "samples_of"]

_DRAWN = ("factor.", "fault.")
_ABOUT = ("row", "variant", "draw", "seed", "outcome", "reason", "duration_s", "version", "digest")
_HIGHER_IS_BETTER = "saving"
_NO_FIGURES = ("wall_s", "duration_s", "min_interval_s", "lost_at_s")
"""Ends of names of columns that are neither good nor bad, or that have none where all is well."""
_UAV = re.compile(r"uav\d+\.")


@dataclass(frozen=True)
class Sample:
    """The flights of one variant, in the order of their draws.

    Attributes:
        variant: Its name.
        table: Its rows of the results.
    """

    variant: str
    table: "pa.Table"

    def __len__(self) -> int:
        return int(self.table.num_rows)

    @cached_property
    def row(self) -> np.ndarray:
        """Row of each flight in the campaign, shape (flights,)."""
        return self._column("row")

    @cached_property
    def draw(self) -> np.ndarray:
        """Number of each flight's draw, shape (flights,)."""
        return self._column("draw")

    @cached_property
    def outcome(self) -> np.ndarray:
        """Outcome of each flight, shape (flights,)."""
        return self._column("outcome")

    @cached_property
    def success(self) -> np.ndarray:
        """Sample flown to their end with attitude and heading kept, bool, shape (flights,)."""
        return happened("success", self.outcome)

    @cached_property
    def factors(self) -> dict[str, np.ndarray]:
        """Drawn values by name; numbers, or texts (and the UAVs of faults) as objects.

        The severity of a fault is signed, and both signs are as bad: its size counts.
        """
        found = {}
        for name in self.table.column_names:
            if name.startswith("factor."):
                found[name.removeprefix("factor.")] = self._factor(name)
            elif name.startswith("fault.") and name.endswith(".severity"):
                found[f"size of {name}"] = np.abs(self._factor(name))
            elif name.startswith("fault."):
                found[name] = self._factor(name)
        return found

    def take(self, indices: np.ndarray) -> "Sample":
        """Return some of the flights."""
        return Sample(self.variant, self.table.take(indices))

    def cost(self, figure: str) -> np.ndarray:
        """Return a figure of each flight as a cost: smaller is better, infinite for a failure.

        Args:
            figure: A column of the results, as in uav3.iae_roll; without the UAV, as in iae_roll,
                the worst of all UAVs counts. Where more is better, as with savings, the cost is
                the negative figure. A flight that succeeded but has no such figure counts as a
                failure, too.

        Returns:
            The costs, shape (flights,).

        Raises:
            BadInput: There is no such figure.
        """
        sign = -1.0 if higher_is_better(figure) else 1.0
        values = [sign * self._numbers(name) for name in self._columns(figure)]
        flown = [each for each in values if not np.isnan(each).all()]  # a variant may lack UAVs
        costs = np.max(flown or values, axis=0)  # NaN if one UAV has none
        return np.where(self.success & np.isfinite(costs), costs, np.inf)

    def _columns(self, figure: str) -> list[str]:
        names = figures_of(self.table)
        if figure in names:
            return [figure]
        if found := [name for name in names if _UAV.sub("", name) == figure]:
            return found
        known = sorted({_UAV.sub("", name) for name in names})
        raise BadInput(
            f"the results have no figure {figure!r}",
            f"expected one of {', '.join(known)}, or one UAV's, as in uav1.{known[0]}",
        )

    def _column(self, name: str) -> np.ndarray:
        return np.asarray(self.table[name].to_numpy())

    def _numbers(self, name: str) -> np.ndarray:
        column = self.table[name].cast("float64")
        return np.asarray(column.to_numpy(), dtype=float)

    def _factor(self, name: str) -> np.ndarray:
        import pyarrow as pa

        column = self.table[name]
        if pa.types.is_floating(column.type):
            values = self._numbers(name)
            return np.where(np.isnan(values), np.inf, values)  # the end of a fault for good
        return np.array([str(value) for value in column.to_pylist()], dtype=object)


def higher_is_better(figure: str) -> bool:
    """Return whether the cost of a figure is its negative."""
    return figure.endswith(_HIGHER_IS_BETTER)


def figures_of(table: "pa.Table") -> list[str]:
    """Return the columns that hold figures of flights."""
    import pyarrow as pa

    return [
        field.name
        for field in table.schema
        if (pa.types.is_floating(field.type) or pa.types.is_integer(field.type))
        and not field.name.startswith(_DRAWN)
        and field.name not in {"row", "draw", "seed"}
        and not field.name.endswith(_NO_FIGURES)
    ]


def read_samples(folder: Path, figures: Iterable[str] | None = None) -> dict[str, Sample]:
    """Read the flights of a campaign that ended so far, by variant.

    Args:
        folder: Folder of the campaign.
        figures: Those wanted, as of `Sample.cost`; of a large campaign, others would fill the
            memory. None for all.

    Raises:
        BadInput: It is no campaign, its results cannot be read, or they hold a flight twice.
    """
    columns = None
    if figures is not None:
        wanted = set(figures)
        names = result_columns(folder)
        columns = [
            name
            for name in names
            if name in _ABOUT or name.startswith(_DRAWN) or {name, _UAV.sub("", name)} & wanted
        ]
    return samples_of(read_results(folder, columns), folder)


def samples_of(table: "pa.Table", origin: Path | str) -> dict[str, Sample]:
    """Divide results by variant, in the order of their rows.

    Raises:
        BadInput: A flight is there twice, which would pretend to more evidence than there is.
    """
    import pyarrow.compute as pc

    rows = table["row"].to_numpy()
    if len(np.unique(rows)) < len(rows):
        values, counts = np.unique(rows, return_counts=True)
        raise BadInput(
            f"the results in {origin} hold row {values[counts > 1][0]} more than once",
            "remove one of the files with it",
        )
    found = {}
    for name in dict.fromkeys(table["variant"].to_pylist()):
        own = table.filter(pc.equal(table["variant"], name))
        found[name] = Sample(name, own.sort_by("draw"))
    return found


def same_draws(old: Sample, new: Sample) -> tuple[Sample, Sample] | None:
    """Return the flights that both have, draw by draw; None if a common draw differs.

    Draws are the same if their seed and every drawn value are; a name or a file proves nothing.
    """
    _, in_old, in_new = np.intersect1d(old.draw, new.draw, return_indices=True)
    if not len(in_old):
        return None
    first, second = old.take(in_old), new.take(in_new)
    names = list(_drawn_names(old.table))
    if set(names) != set(_drawn_names(new.table)):
        return None
    if any(not first.table[name].equals(second.table[name]) for name in ("seed", *names)):
        return None
    return first, second


def _drawn_names(table: "pa.Table") -> Iterable[str]:
    return (name for name in table.column_names if name.startswith(_DRAWN))

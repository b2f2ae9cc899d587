"""The flights of a campaign by variant, as arrays for statistics."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ftc_lab.campaigns.conditions import happened
from ftc_lab.campaigns.factors import SEVERITY, DrawnValue, drawn_columns, fault_of
from ftc_lab.campaigns.faults import LOSS
from ftc_lab.campaigns.store import Results
from gcs.console.errors import BadInput
from gcs.results.figures import better_of

if TYPE_CHECKING:
    import pyarrow as pa

_UAV = re.compile(r"uav\d+\.")


@dataclass(frozen=True)
class Sample:
    """The flights of one variant, in the order of their draws.

    Attributes:
        variant: Its name.
        source: Results, from which columns are taken when they are needed.
        where: Places of the flights in these columns, shape (flights,).
    """

    variant: str
    source: "Results | pa.Table"
    where: np.ndarray

    def __len__(self) -> int:
        return len(self.where)

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
        return self.texts("outcome")

    @cached_property
    def success(self) -> np.ndarray:
        """Flights flown to their end with attitude and heading kept, bool, shape (flights,)."""
        return happened("success", self.outcome)

    def factors(self) -> Iterator[tuple[str, np.ndarray]]:
        """Yield name and drawn values of each factor; numbers, or texts as objects.

        A fault's UAV is a text: it has no order. A severity is NaN for flights with a fault of
        another kind. It is signed, and both signs are as bad: its size counts.
        """
        for each in self._factors:
            yield each.name, self._values(each)

    def factor(self, factor: str) -> np.ndarray:
        """Return the drawn values of one factor, by its name as `factors` has it."""
        return self._values(next(each for each in self._factors if each.name == factor))

    @cached_property
    def _factors(self) -> list[DrawnValue]:
        """The factors of all variants, also those that none of these flights has."""
        whole = Sample("", self.source, np.arange(len(self.source.column("row"))))
        return [
            factor
            for column in drawn_columns(self.source.schema)
            for factor in (
                whole._severities(column) if column.endswith(SEVERITY) else [DrawnValue(column)]
            )
        ]

    def _severities(self, column: str) -> list[DrawnValue]:
        """Return the severities of a fault that mean the same, each with the kinds that it has."""
        alike = len(np.unique(self._throttle(column))) < 2
        return [
            DrawnValue(column, kind, actuators)
            for kind in sorted(set(self.texts(f"{fault_of(column)}.kind")))
            for actuators in ([None] if alike or kind == LOSS else ["surface", "throttle"])
        ]

    def _throttle(self, column: str) -> np.ndarray:
        """Return which flights have their fault at the throttle, bool, shape (flights,)."""
        return np.asarray(self.texts(f"{fault_of(column)}.actuator") == "throttle")

    def numbers(self, name: str) -> np.ndarray:
        """Return a column of numbers, shape (flights,); NaN where there is none."""
        column = self.cells(name).cast("float64")
        return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float)

    def cells(self, name: str) -> "pa.Array":
        """Return a column as it is stored."""
        import pyarrow as pa

        column = self.source.column(name)
        whole = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
        return whole.take(pa.array(self.where))

    def take(self, indices: np.ndarray) -> "Sample":
        """Return some of the flights."""
        return Sample(self.variant, self.source, self.where[indices])

    def cost(self, figure: str) -> np.ndarray:
        """Return a figure of each flight as a cost: smaller is better, infinite for a failure.

        Args:
            figure: A column of the results, as in uav3.iae_roll; without the UAV, as in iae_roll,
                the worst of all UAVs counts. Where more is better, as with savings and distances,
                the cost is the negative figure. A flight that succeeded but has no such figure
                counts as a failure, too.

        Returns:
            The costs, shape (flights,).

        Raises:
            BadInput: There is no such figure.
        """
        sign = -1.0 if higher_is_better(figure) else 1.0
        values = [sign * self.numbers(name) for name in self._columns(figure)]
        flown = [each for each in values if not np.isnan(each).all()]  # a variant may lack UAVs
        costs = np.max(flown or values, axis=0)  # NaN if one UAV has none
        return np.where(self.success & np.isfinite(costs), costs, np.inf)

    def _columns(self, figure: str) -> list[str]:
        names = figures_of(self.source.schema)
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
        return np.asarray(self.cells(name).to_numpy(zero_copy_only=False))

    def texts(self, name: str) -> np.ndarray:
        """Return a column of texts (None: null) as objects; equal ones are one in memory."""
        coded = self.cells(name)
        if not hasattr(coded, "dictionary"):
            coded = coded.dictionary_encode()
        known = np.array([*coded.dictionary.to_pylist(), None], dtype=object)
        return np.asarray(known[coded.indices.fill_null(len(known) - 1).to_numpy()])

    def _values(self, factor: DrawnValue) -> np.ndarray:
        import pyarrow as pa

        name = factor.column
        if factor.kind is not None:
            meant = self.texts(f"{fault_of(name)}.kind") == factor.kind
            if factor.actuators is not None:
                meant &= self._throttle(name) == (factor.actuators == "throttle")
            return np.where(meant, np.abs(self.numbers(name)), np.nan)
        kind = self.source.schema.field(name).type
        if pa.types.is_floating(kind):
            values = self.numbers(name)
            return np.where(np.isnan(values), np.inf, values)  # the end of a fault for good
        if pa.types.is_integer(kind):
            return np.asarray(self._column(name).astype(str), dtype=object)
        return self.texts(name)


def higher_is_better(figure: str) -> bool:
    """Return whether the cost of a figure is its negative."""
    return better_of(_UAV.sub("", figure)) == "higher"


def figures_of(schema: "pa.Schema") -> list[str]:
    """Return the columns that hold figures of flights by which one is better than another."""
    return [name for name in schema.names if better_of(_UAV.sub("", name)) is not None]


def read_samples(folder: Path) -> dict[str, Sample]:
    """Return the flights of a campaign that ended so far, by variant.

    Columns are read when they are needed, so that a million flights fit into memory.

    Raises:
        BadInput: It is no campaign, its results cannot be read, or they hold a flight twice.
    """
    return samples_of(Results(folder), folder)


def samples_of(source: "Results | pa.Table", origin: Path | str) -> dict[str, Sample]:
    """Divide results by variant, in the order of their rows.

    Raises:
        BadInput: A flight is there twice, which would pretend to more evidence than there is.
    """
    everything = Sample("", source, np.arange(len(source.column("row"))))
    values, counts = np.unique(everything.row, return_counts=True)
    if len(values) < len(everything):
        raise BadInput(
            f"the results in {origin} hold row {values[counts > 1][0]} more than once",
            "remove one of the files with it",
        )
    variant = everything.take(np.argsort(everything.row, kind="stable")).texts("variant")
    order = np.lexsort((everything.row, everything.draw))
    ordered = everything.take(order).texts("variant")
    return {name: Sample(name, source, order[ordered == name]) for name in dict.fromkeys(variant)}


def same_draws(old: Sample, new: Sample) -> tuple[Sample, Sample] | None:
    """Return the flights that both have, draw by draw; None if a common draw differs.

    Draws are the same if their seed and every drawn value are; a name or a file proves nothing.
    Within one campaign they are: its draws are made once, for all variants.
    """
    _, in_old, in_new = np.intersect1d(old.draw, new.draw, return_indices=True)
    if not len(in_old):
        return None
    first, second = old.take(in_old), new.take(in_new)
    if old.source is new.source:
        return first, second
    names = drawn_columns(old.source.schema)
    if set(names) != set(drawn_columns(new.source.schema)):
        return None
    if any(_differs(first, second, name) for name in ("seed", *names)):
        return None
    return first, second


def _differs(first: Sample, second: Sample, name: str) -> bool:
    old, new = (sample.cells(name) for sample in (first, second))
    if hasattr(old, "dictionary") or hasattr(new, "dictionary"):
        old, new = old.cast("string"), new.cast("string")
    return not old.equals(new)

"""The faults that an aircraft has, as the plant keeps them."""

from collections.abc import Mapping, Sequence

import numpy as np

from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import Family, Target

FAULT = np.dtype(
    [
        ("target", "i8"),  # its number on the wire, -1: slot empty (and every one behind it)
        ("code", "i8"),  # number of the kind
        ("value", "f8"),  # what the kind makes of it, in the target's units of the plant
        ("start", "f8"),  # exclusive, simulation time [s]
        ("end", "f8"),  # inclusive, simulation time [s]
        ("effectiveness", "f8"),  # remaining
        ("frequency", "f8"),  # of the value [Hz]
        ("instance", "i8"),  # from 1; of what has none, 0
        ("axis", "i8"),  # FTC_AXIS
    ]
)
"""A fault of one target, its fields in the order of `Fault`."""

_EMPTY = -1


def no_faults(family: Family, aircraft_count: int) -> np.ndarray:
    """Return empty rows of dtype `FAULT`, shape (aircraft_count, the family's `most`)."""
    rows = np.zeros((aircraft_count, family.most), FAULT)
    rows["target"] = _EMPTY
    return rows


class FaultTable:
    """The faults of one family that one aircraft has."""

    def __init__(
        self, family: Family, rows: np.ndarray, instances: Mapping[str, Sequence[int]] | None = None
    ) -> None:
        """Take over the rows of an aircraft.

        Args:
            family: The family.
            rows: Of dtype `FAULT`, shape (n,), which the table changes.
            instances: Numbers of what there is, by the name of the target; None: one of each.
        """
        self._family, self._rows, self._instances = family, rows, instances

    def numbers(self, fault: Fault) -> list[int]:
        """Return the numbers of the instances that a fault names; none if there is no such one."""
        if self._instances is None:
            return [0]
        there = self._instances.get(fault.target.name, ())
        return [number for number in there if fault.instance in {0, number}]

    def set(self, faults: Sequence[Fault], now_s: float) -> None:
        """Add faults, for each instance that they name; of the others those remain that `stay`.

        Args:
            faults: As the wire carries them: NaN start now, NaN end open.
            now_s: Simulation time [s].

        Raises:
            OverflowError: All slots are taken by other faults; nothing has changed.
        """
        new = [
            fault.resolved(now_s)._replace(instance=number)
            for fault in faults
            for number in self.numbers(fault)
        ]
        kept = [
            row
            for row, old in zip(self._there, self.faults, strict=True)
            if all(old.stays(fault, now_s) for fault in new)
        ]
        if len(kept) + len(new) > len(self._rows):
            text = f"all {len(self._rows)} {self._family.slots} are in use; clear some first"
            raise OverflowError(text)
        self._write([*kept, *map(_row, new)])

    def clear(self, target: Target | None = None, instance: int = 0) -> None:
        """Remove the faults of a target, None: of all; of one instance, 0: of all."""
        there = self._there
        meant = np.full(len(there), target is None)
        if target is not None:
            meant |= there["target"] == self._family.number_of(target)
        meant &= (there["instance"] == instance) | (instance == 0)
        self._write(there[~meant])

    @property
    def faults(self) -> list[Fault]:
        """All of them, past and future ones included, as the wire carries them."""
        return [self._fault(row) for row in self._there]

    @property
    def _there(self) -> np.ndarray:
        there: np.ndarray = self._rows[self._rows["target"] != _EMPTY]
        return there

    def _fault(self, row: np.void) -> Fault:
        number, code, value, *rest = row.item()
        target = self._family.target(number)
        kind = self._family.kind(code, row["effectiveness"])
        assert target is not None  # only known ones are written
        assert kind is not None
        return Fault(target, kind, value * (1.0 / kind.per_unit(target)), *rest)

    def _write(self, rows: Sequence[np.void]) -> None:
        self._rows[:] = no_faults(self._family, 1)[0]
        for i, row in enumerate(rows):
            self._rows[i] = row


def _row(fault: Fault) -> np.void:
    value = fault.value * fault.kind.per_unit(fault.target)
    fields = fault._replace(value=value)[2:]
    row: np.void = np.array([(fault.number, fault.code, *fields)], FAULT)[0]
    return row

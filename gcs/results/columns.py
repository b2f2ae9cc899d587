"""Columns of a recorded trajectory: each a number of one UAV at one step, in SI units and rad."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ftc_autopilot.control.signals import SIGNALS
from gcs.results.quantities import QUANTITIES
from gcs.results.recording import Steps
from mavlink_defs.constants import ACTUATORS

_TRACKED = dict(zip(QUANTITIES, ("m/s", "rad", "rad", "rad"), strict=True))
_RATES = dict(zip(QUANTITIES, ("m/s²", "rad/s", "rad/s", "rad/s"), strict=True))
_COMMANDS: dict[str, str] = dict(zip(ACTUATORS, ("rad", "rad", "rad", "N"), strict=True))
_STATE = {
    **dict.fromkeys(("north", "east", "down"), "m"),
    **dict.fromkeys("uvw", "m/s"),
    **dict.fromkeys(("roll", "pitch", "yaw"), "rad"),
    **dict.fromkeys("pqr", "rad/s"),
}

# names and units of the elements of signals that have several, and units of others
_ELEMENTS: dict[str, Mapping[str, str]] = {
    "attitude": {"roll": "rad", "pitch": "rad", "yaw": "rad"},
    "command": _TRACKED,
    "reference": _TRACKED,
    "reference_dot": _RATES,
    "error": _TRACKED,
    "sync_error": _TRACKED,
    "demand": _COMMANDS,
    "held": _COMMANDS,
    "slot": dict.fromkeys(("ahead", "right", "up"), "m"),
    "omega_d": dict.fromkeys("pqr", "rad/s"),
    "omega_d_dot": dict.fromkeys("pqr", "rad/s²"),
    "e_omega": dict.fromkeys("pqr", "rad/s"),
    "zeta_omega": dict.fromkeys("pqr", ""),
    "effectiveness": dict.fromkeys(_COMMANDS, ""),
    "offset": _COMMANDS,
    "confidence": dict.fromkeys(_COMMANDS, ""),
    "phase": dict.fromkeys(_COMMANDS, ""),
    "predicted_exit": dict.fromkeys(_COMMANDS, "s"),
}
_UNITS = {"V": "m/s", "V_dot": "m/s²", "path_position": "m"}


@dataclass(frozen=True)
class Column:
    """A column and where its values are.

    Attributes:
        name: As in files.
        unit: Empty for counts, shares and inner quantities of the law.
        array: Field of `Steps`.
        field: Field of its dtype, empty if it has none.
        index: Of the last axis, None if it has none.
    """

    name: str
    unit: str
    array: str
    field: str
    index: int | None

    @property
    def dtype(self) -> np.dtype:
        """Type of the values."""
        return SIGNALS[self.field].base if self.field else np.dtype("f8")

    def of(self, steps: Steps) -> np.ndarray:
        """Return the values, shape (steps, n), as a view that can be written, too."""
        array: np.ndarray = getattr(steps, self.array)
        if self.field:
            array = array[self.field]
        return array if self.index is None else array[..., self.index]


def _columns() -> Iterator[Column]:
    for k, (name, unit) in enumerate(_STATE.items()):
        yield Column(name, unit, "states", "", k)
    for k, axis in enumerate("uvw"):
        yield Column(f"wind_{axis}", "m/s", "wind", "", k)
    for k, (name, unit) in enumerate(_COMMANDS.items()):
        yield Column(f"applied_{name}", unit, "applied", "", k)
    for field in SIGNALS.names or ():
        if not SIGNALS[field].shape:
            yield Column(field, _UNITS.get(field, ""), "signals", field, None)
            continue
        for k, (name, unit) in enumerate(_ELEMENTS[field].items()):
            yield Column(f"{field}_{name}", unit, "signals", field, k)


COLUMNS = tuple(_columns())
"""Everything that is recorded."""

ESTIMATES = tuple(
    Column(f"estimated_{name}", unit, "estimates", "", k)
    for k, (name, unit) in enumerate((*_STATE.items(), *((f"wind_{a}", "m/s") for a in "uvw")))
)
"""What is recorded besides of a flight by an estimated state: the estimate."""

_LIGHT_SIGNALS = {"V", "command", "reference", "error", "held", "path_position", "slot"}

LIGHT = tuple(
    column for column in COLUMNS if column.array != "signals" or column.field in _LIGHT_SIGNALS
)
"""What a light recording has: the motion, the wind, commands, references and what was applied."""

_LIGHT_ESTIMATES = tuple(column for column in ESTIMATES if column.unit != "rad/s")


def columns_of(*, light: bool, estimated: bool) -> tuple[Column, ...]:
    """Return what a recording has, light or full, of a flight by true or estimated states."""
    columns = LIGHT if light else COLUMNS
    if not estimated:
        return columns
    return (*columns, *(_LIGHT_ESTIMATES if light else ESTIMATES))

"""What was drawn, as statistics and reports take it: one factor for each thing with one meaning.

Severities of unlike faults are no one factor: a loss of half the command and a surface stuck
at half its limit have the same number and harm differently. Pooled, a kind with larger numbers
and less harm turns the sign (Simpson's paradox). So each kind has a factor of its own; of a bias
and a stuck position, which are shares of the actuator's limit, throttle and surfaces have one each.
"""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from pydantic.fields import FieldInfo

from gcs.scenario.model import Scenario
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import describe

if TYPE_CHECKING:
    import pyarrow as pa

SEVERITY = ".severity"
"""End of the name of a column with the severities of a fault, whatever its kind."""

_DRAWN = ("factor.", "fault.")
_PARTS = {
    "uav": "UAV",
    "actuator": "actuator",
    "sensor": "sensor",
    "instance": "number of the sensor",
    "kind": "kind",
    "start_s": "onset [s]",
    "end_s": "end [s]",
    "severity": "severity",
    "value": "value, in the unit of the sensor's kind",
}
"""Columns of a fault as readers see them."""


@dataclass(frozen=True)
class DrawnValue:
    """Something that was drawn.

    Attributes:
        column: Column of the results.
        kind: Kind of fault whose severity it is; None of anything else.
        actuators: ``throttle`` or ``surface``, whose severities alone it has; None for all.
    """

    column: str
    kind: str | None = None
    actuators: str | None = None

    @property
    def name(self) -> str:
        """Name among the factors, as in mass, fault.any.kind, fault.any.severity[stuck]."""
        if self.kind is None:
            return self.column.removeprefix("factor.")
        return f"{self.column}[{' '.join(filter(None, (self.kind, self.actuators)))}]"


def drawn_columns(schema: "pa.Schema") -> list[str]:
    """Return the columns of what was drawn."""
    return [name for name in schema.names if name.startswith(_DRAWN)]


def fault_of(column: str) -> str:
    """Return the beginning of all columns of the fault that has a column, as in fault.any."""
    return column.rpartition(".")[0]


def title_of(factor: str, unit: str = "") -> str:
    """Return a factor's name as reports show it, with its unit.

    Args:
        factor: Name, as `Factor.name` has it, or a column of the results.
        unit: Unit of a factor that is no part of a fault.
    """
    if not factor.startswith("fault."):
        return factor.removeprefix("factor.") + (f" [{unit}]" if unit else "")
    fault, _, part = factor.removeprefix("fault.").rpartition(".")
    part, _, kind = part.partition("[")
    if not kind:
        return f"fault {fault}: {_PARTS.get(part, part)}"
    return f"fault {fault}: {kind[:-1]} [share of {'command' if kind == 'loss]' else 'limit'}]"


def unit_of(scenario: Scenario, key: str) -> str:
    """Return the unit of a key of a scenario, in ASCII; empty if it has none or is not there."""
    here: Any = scenario
    unit = ""
    for name, index in re.findall(r"(\w+)|\[(\d+)\]", key):
        if isinstance(here, Model) and name in type(here).model_fields:
            unit, here = _unit(type(here).model_fields[name]), getattr(here, name)
        elif isinstance(here, dict) and name in here:
            here = here[name]
        elif isinstance(here, tuple) and index and int(index) < len(here):
            here = here[int(index)]
        else:
            return ""
    return unit


def _unit(field: FieldInfo) -> str:
    """Return the unit of a field, or of the numbers of which it is a list or a schedule."""
    kind: Any = field.annotation
    inner = getattr(kind, "__pydantic_generic_metadata__", {}).get("args", ())
    parts = (kind, *inner, *get_args(kind))
    declared = (field, *(each for part in parts for each in getattr(part, "__metadata__", ())))
    found = (describe(each) for each in declared if isinstance(each, FieldInfo))
    return next((quantity.unit for quantity in found if quantity is not None), "")

"""Numbers of a configuration: unit and bounds declared together, once.

What a field declares with `quantity` or `whole` is what the loader checks, what its error
messages contain, and what help pages and the parameter protocol look up with `describe`. Its
meaning stands below "Attributes" in the docstring of its model, as with every key::

    mass_kg: float = quantity("kg", gt=0.0)
"""

from dataclasses import dataclass
from typing import Any

from pydantic import Field
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined


@dataclass(frozen=True)
class Quantity:
    """The declaration of a numeric field.

    Attributes:
        unit: Unit in ASCII, such as "m/s^2"; empty for a pure number.
        gt: The number must be greater than this.
        ge: The number must be at least this.
        lt: The number must be less than this.
        le: The number must be at most this.
        doc: What the number means.
    """

    unit: str
    gt: float | None
    ge: float | None
    lt: float | None
    le: float | None
    doc: str

    def range(self) -> str:
        """Return the permitted range as a text: "[0, 0.8] rad", "> 0 kg", "any number"."""
        return f"{self.bounds()} {self.unit}".rstrip()

    def bounds(self) -> str:
        """Return the same without the unit: "[0, 0.8]"."""
        low = self.ge if self.gt is None else self.gt
        high = self.le if self.lt is None else self.lt
        if low is not None and high is not None:
            opening, closing = "[" if self.gt is None else "(", "]" if self.lt is None else ")"
            text = f"{opening}{low:.12g}, {high:.12g}{closing}"
        elif low is not None:
            text = f"{'>=' if self.gt is None else '>'} {low:.12g}"
        elif high is not None:
            text = f"{'<=' if self.lt is None else '<'} {high:.12g}"
        else:
            text = "any number"
        return text


def quantity(
    unit: str,
    doc: str = "",
    default: Any = PydanticUndefined,
    *,
    gt: float | None = None,
    ge: float | None = None,
    lt: float | None = None,
    le: float | None = None,
) -> Any:
    """Declare a finite real number; integers are taken, texts and truth values are not.

    Args:
        unit: Unit in ASCII; empty for a pure number.
        doc: What the number means, where no docstring of a model says it: of parts of lists.
        default: Value when the key is absent; without one the key must be given.
        gt: Exclusive lower bound.
        ge: Inclusive lower bound.
        lt: Exclusive upper bound.
        le: Inclusive upper bound.

    Returns:
        A pydantic Field, for a field of type `float` or for use in `Annotated`.
    """
    declared = Quantity(unit, gt, ge, lt, le, doc)
    return _field(declared, default, allow_inf_nan=False)


def whole(
    unit: str,
    doc: str = "",
    default: Any = PydanticUndefined,
    *,
    ge: int | None = None,
    le: int | None = None,
) -> Any:
    """Declare a whole number, for a field of type `int`; arguments as of `quantity`."""
    return _field(Quantity(unit, None, ge, None, le, doc), default)


def describe(field: FieldInfo) -> Quantity | None:
    """Return what `quantity` or `whole` declared for a field; None for any other field."""
    extra: Any = field.json_schema_extra
    declared = extra.get("quantity") if isinstance(extra, dict) else None
    return Quantity(**declared, doc=field.description or "") if declared else None


def _field(declared: Quantity, default: Any, **constraints: Any) -> Any:
    bounds = {name: getattr(declared, name) for name in ("gt", "ge", "lt", "le")}
    return Field(
        default,
        strict=True,
        description=declared.doc,
        json_schema_extra={"quantity": {"unit": declared.unit, **bounds}},
        **{name: bound for name, bound in bounds.items() if bound is not None},
        **constraints,
    )

"""Gains K1, K2 of Table III, which more than one law uses."""

from typing import Annotated, TypeAlias

from mavlink_defs.config.quantity import quantity

_Gain = Annotated[float, quantity("1/s", gt=0.0, le=500.0, doc="Gain of one axis.")]
Gains: TypeAlias = tuple[_Gain, _Gain, _Gain]

TABLE_III_K1 = (
    {"until_s": 5.0, "value": (50.0, 50.0, 51.0)},
    {"until_s": 15.0, "value": (45.0, 45.0, 45.0)},
    {"value": (40.0, 40.0, 40.0)},
)
TABLE_III_K2 = (
    {"until_s": 5.0, "value": (50.0, 50.0, 51.0)},
    {"until_s": 15.0, "value": (45.0, 45.0, 46.0)},
    {"value": (40.0, 40.0, 40.0)},
)

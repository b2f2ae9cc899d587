"""Parameters of fence and rally points, with the names and the meaning that they have in ArduPlane.

https://ardupilot.org/plane/docs/parameters.html#fence-parameters and #rally-parameters.
"""

from typing import Literal, NamedTuple, get_args

import numpy as np

from ftc_autopilot.common.records import fill, record_dtype
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity, whole

ALT_MAX, AROUND_HOME, AREAS, ALT_MIN = 1, 2, 4, 8
"""Bits of `FenceParameters.type`."""

ActionName = Literal["report", "rtl", "loiter", "guided", "land"]
REPORT, TO_RTL, TO_LOITER, TO_GUIDED, TO_LAND = ACTION_NUMBERS = 0, 1, 4, 6, 8
"""FENCE_ACTION of each `ActionName`: ArduPlane's; 4 is what stops a copter."""


class FenceParameters(Model):
    """What of a fence is watched, and what a breach does.

    Attributes:
        enable: Whether the fence is watched.
        type: What is watched, summed up: 1 greatest height, 2 circle around home, 4 areas, 8 least
            height.
        action: What a breach does: it is reported, and the mode becomes RTL, LOITER, GUIDED to the
            return point, or a landing is flown.
        alt_max_m: Greatest height above home.
        alt_min_m: Least height above home.
        radius_m: Radius of the circle around home.
        margin_m: How far inside a breach is over, and how far from limits heights are flown.
        ret_rally: Whether GUIDED leads where RTL does, not to the return point.
        ret_alt_m: Height above home at the return point; 0: the present one, within the limits.
    """

    enable: bool = False
    type: int = whole("", default=AREAS, ge=0, le=ALT_MAX + AROUND_HOME + AREAS + ALT_MIN)
    action: ActionName = "rtl"
    alt_max_m: float = quantity("m", default=100.0, ge=-1e5, le=1e5)
    alt_min_m: float = quantity("m", default=-10.0, ge=-1e5, le=1e5)
    radius_m: float = quantity("m", default=300.0, gt=0.0, le=1e5)
    margin_m: float = quantity("m", default=2.0, ge=0.0, le=1e3)  # fmt: skip
    ret_rally: bool = False
    ret_alt_m: float = quantity("m", default=0.0, ge=0.0, le=1e5)  # fmt: skip


class RallyParameters(Model):
    """Which of the rally points, and home, RTL leads to.

    Attributes:
        limit_km: Farthest rally point that is used; farther ones: home; 0: any.
        incl_home: Whether home is used if it is nearer than all rally points.
    """

    limit_km: float = quantity("km", default=5.0, ge=0.0, le=1e3)
    incl_home: bool = False


class FenceRecords(NamedTuple):
    """The numbers in force, as of the two models, shape (1,); the action is FENCE_ACTION."""

    fence: np.ndarray
    rally: np.ndarray


def fence_records(fence: FenceParameters, rally: RallyParameters) -> FenceRecords:
    """Return records of parameters, which commands and the parameter protocol change."""
    models = FenceParameters, RallyParameters
    made = FenceRecords(*(np.zeros(1, record_dtype(model)) for model in models))
    for record, model in zip(made, (fence, rally), strict=True):
        fill(record[0], model)
    made.fence["action"] = ACTION_NUMBERS[get_args(ActionName).index(fence.action)]
    return made

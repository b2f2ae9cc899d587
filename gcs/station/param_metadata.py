"""Unit, range and meaning of vehicles' parameters, which the parameter protocol does not carry."""

import functools

import numpy as np

from ftc_autopilot.control.controller import PARAMETERS
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.guidance.formation import FormationParameters
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.vehicle.param_table import trigger_tunables, tunables
from gcs.station.param_file import READ_ONLY
from mavlink_defs.config.quantity import Quantity

__all__ = ["READ_ONLY", "known_quantity", "permitted"]

_TOLD = {
    "SYSID_THISMAV": "System id, read only.",
    "MAV_TYPE": "MAV_TYPE of the heartbeat, read only.",
    "MAV_AUTOPILOT": "MAV_AUTOPILOT of the heartbeat, read only.",
    "STEP_US": "Control period, read only.",
    "CTRL_LAW": ", ".join(f"{i} {kind}" for i, kind in enumerate(LAWS)) + "; read only.",
}


def permitted(name: str) -> str:
    """Return which values a parameter takes: "[0, 10] deg", "read only"; "" if that is unknown."""
    if name in READ_ONLY:
        return "read only"
    known = known_quantity(name)
    return known.range() if known else ""


def known_quantity(name: str) -> Quantity | None:
    """Return unit, range and meaning of a parameter; None for one that our vehicles lack."""
    return _known().get(name)


@functools.cache
def _known() -> dict[str, Quantity]:
    records = np.zeros(1, PARAMETERS)
    found = [
        *trigger_tunables(records),
        *tunables(LawParameters, records["common"]),
    ]
    found += tunables(FormationParameters, records["formation"], "FORM_")
    for kind, guidance in GUIDANCE_LAWS.items():
        found += tunables(guidance, records["guidance"][kind], "GUID_", base=GuidanceParameters)
    for mode in MODES:
        found += trigger_tunables(records, mode)
    for kind, law in LAWS.items():
        found += tunables(law, records[kind], base=LawParameters)
    told = {name: Quantity("", None, None, None, None, doc) for name, doc in _TOLD.items()}
    told["STEP_US"] = Quantity("us", None, None, None, None, _TOLD["STEP_US"])
    return told | {tunable.name: tunable.quantity for tunable in reversed(found)}

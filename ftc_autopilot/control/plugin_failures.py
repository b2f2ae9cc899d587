"""Plug-ins that have failed in flight: which, and why."""

import numpy as np

from ftc_autopilot.control.plugin_functions import Chosen
from ftc_autopilot.plugins.functions import failure_text
from ftc_autopilot.plugins.models import PLUGIN


def failure_of(uav: np.void, chosen: Chosen, time_s: float) -> str | None:
    """Return which plug-in of a UAV has failed and why; None if none has.

    Args:
        uav: Record of dtype `ftc_autopilot.control.controllers.UAV`.
        chosen: What it flies by.
        time_s: When they were called last [s].
    """
    state, guidance = uav["controller"], uav["guidance"]["law"]
    for what, model, status in (
        ("law", chosen.controller, state["law_failure"]),
        ("trigger", chosen.trigger, state["trigger"][PLUGIN]["failure"]),
        ("guidance law", chosen.guidance, guidance[PLUGIN]["failure"]),
    ):
        if status != 0:
            return failure_text(what, type(model), int(status), time_s)
    return None


def clear_failures(uav: np.void) -> None:
    """Forget that a plug-in of a UAV has failed."""
    state = uav["controller"]
    state["law_failure"] = state["trigger"][PLUGIN]["failure"] = 0
    uav["guidance"]["law"][PLUGIN]["failure"] = 0

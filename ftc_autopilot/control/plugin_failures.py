"""Plug-ins that have failed in flight: which, and why."""

from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.plugin_functions import Chosen
from ftc_autopilot.plugins.functions import failure_text
from ftc_autopilot.plugins.models import PLUGIN


def failure_of(controllers: Controllers, i: int, chosen: Chosen, time_s: float) -> str | None:
    """Return which plug-in of UAV i has failed and why; None if none has.

    Args:
        controllers: The controllers.
        i: Index of the UAV.
        chosen: What it flies by.
        time_s: When they were called last [s].
    """
    state, guidance = controllers.states[i], controllers.guidance[i]["law"]
    for what, model, status in (
        ("law", chosen.controller, state["law_failure"]),
        ("trigger", chosen.trigger, state["trigger"][PLUGIN]["failure"]),
        ("guidance law", chosen.guidance, guidance[PLUGIN]["failure"]),
    ):
        if status != 0:
            return failure_text(what, type(model), int(status), time_s)
    return None


def clear_failures(controllers: Controllers, i: int) -> None:
    """Forget that a plug-in of UAV i has failed."""
    state = controllers.states[i]
    state["law_failure"] = state["trigger"][PLUGIN]["failure"] = 0
    controllers.guidance[i]["law"][PLUGIN]["failure"] = 0

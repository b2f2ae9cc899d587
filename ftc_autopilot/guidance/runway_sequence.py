"""A formation takes off from one runway one after the other, as it stands, and lands so.

Nobody gives an order. A member waits while another one is ahead of it on the runway, and until that
is off the ground and the spacing away: a take-off that is rejected keeps all behind it on the
ground. From the line of the landing on each flies by itself, without its slot. After touchdown it
rolls on, to leave room for those that are still to come.
"""

import math
from itertools import pairwise

import numpy as np

from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.places import is_known, place_now
from ftc_autopilot.guidance.runway import RunwayFigures
from ftc_autopilot.guidance.runway_state import FINAL, FLARE, STANDING
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3

_HEARD_S = 2.0
"""Time on the ground in which a member that nothing is known of is waited for [s]."""


def why_not_in_sequence(formation: Formation, figures: RunwayFigures) -> str | None:
    """Return why a formation cannot land from its last slots; None if it can.

    Args:
        formation: The formation.
        figures: Of one of its aircraft.
    """
    last = formation.plans()[-1]
    order = sorted(last, key=lambda uav: -last[uav].ahead_m)
    for one, other in pairwise(order):
        apart = last[one].ahead_m - last[other].ahead_m
        if apart < figures.spacing:
            text = f"UAVs {one} and {other} fly {apart:g} m apart along the path at the end, must"
            text += f" be >= {figures.spacing:g} m (runway_guidance.spacing_m) to land one after"
            return text + " the other; change the slots to a line astern before"
    roll = figures.landing_roll + (len(last) - 1) * figures.room
    if 0.0 < figures.length < roll:
        return f"the runway is {figures.length:g} m long, {len(last)} landings take {roll:.0f} m"
    return None


@compiled
def lands_alone(path: np.void, s: float) -> bool:
    """Return whether a member at s is on the line of its landing, or on the way around to it."""
    return bool(path["landing"] > 0.0 and path["final"] <= s)


@compiled
def note_others(now: Situation, step: int, dt: float, path: np.void, uav: np.void) -> None:
    """Note whether to wait for another member's take-off, or how far to roll on for those behind.

    Args:
        now: The situation.
        step: Present step.
        dt: Control period [s].
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        uav: Record of dtype `ftc_autopilot.control.controllers.UAV`, `runway` updated in place.
    """
    runway = uav["guidance"]["runway"]
    if runway["phase"] == STANDING:
        runway["waits"] = int(_waits(now, step, dt, uav))
    elif runway["phase"] in (FINAL, FLARE):
        layout, behind = uav["layout"], 0
        for m in range(layout["count"]):
            place = uav["formation"]["places"][m]
            if m != layout["own"] and is_known(place, step, dt):
                behind += 1 if _from_here(now, place, step, dt)[0] < 0.0 else 0
        runway["brake_from"] = path["landing"] + behind * uav["parameters"]["runway"]["room"]


@compiled
def _waits(now: Situation, step: int, dt: float, uav: np.void) -> bool:
    """Return whether another member takes off first; arguments as of `note_others`."""
    figures, layout = uav["parameters"]["runway"], uav["layout"]
    for m in range(layout["count"]):
        place = uav["formation"]["places"][m]
        if m == layout["own"]:
            continue
        if not is_known(place, step, dt):
            if uav["guidance"]["runway"]["time"] < _HEARD_S:
                return True
            continue
        along, across, up = _from_here(now, place, step, dt)
        clear = figures["spacing"]
        if up < figures["span"]:  # it is on the runway
            clear += figures["take_off_roll"]
        if 0.0 < along < clear and abs(across) < figures["width"]:
            return True
    return False


@compiled
def _from_here(now: Situation, place: np.void, step: int, dt: float) -> Vec3:
    """Return how far ahead along the path, to the right and up a member is [m]."""
    north, east, down = place_now(place, step * dt, dt)
    north, east = north - now.position[0], east - now.position[1]
    cos_c, sin_c = math.cos(now.here.course), math.sin(now.here.course)
    return cos_c * north + sin_c * east, cos_c * east - sin_c * north, now.position[2] - down

"""Take-off of a formation from one runway: one after the other, as they stand.

Nobody gives an order. A member waits while another one is ahead of it on the runway, and until that
is off the ground and the spacing away: a take-off that is rejected keeps all behind it on the
ground.
"""

import math

import numpy as np

from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.places import is_known, place_now
from mavlink_defs.runtime.jit import compiled

_HEARD_S = 2.0
"""Time on the ground in which a member that nothing is known of is waited for [s]."""


@compiled
def is_behind(
    now: Situation, step: int, dt: float, layout: np.void, formation: np.void, uav: np.void
) -> bool:
    """Return whether another member takes off first.

    Args:
        now: The situation.
        step: Present step.
        dt: Control period [s].
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        formation: Record of dtype `ftc_autopilot.guidance.coordination.FORMATION`.
        uav: Record of dtype `ftc_autopilot.control.controllers.UAV`.
    """
    figures, stands_s = uav["parameters"]["runway"], uav["guidance"]["runway"]["time"]
    cos_c, sin_c = math.cos(now.here.course), math.sin(now.here.course)
    for m in range(layout["count"]):
        if m == layout["own"]:
            continue
        place = formation["places"][m]
        if not is_known(place, step, dt):
            if stands_s < _HEARD_S:
                return True
            continue
        north, east, down = place_now(place, step * dt, dt)
        north, east = north - now.position[0], east - now.position[1]
        along, across = cos_c * north + sin_c * east, cos_c * east - sin_c * north
        on_runway = now.position[2] - down < figures["span"]
        clear = figures["spacing"] + (figures["take_off_roll"] if on_runway else 0.0)
        if 0.0 < along < clear and abs(across) < figures["width"]:
            return True
    return False

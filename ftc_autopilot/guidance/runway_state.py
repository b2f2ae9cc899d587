"""The phase of take-off or landing that an aircraft is in, and what goes with it."""

import math

import numpy as np

from ftc_autopilot.guidance.laws.base import Situation
from mavlink_defs.runtime.jit import compiled

FLYING, STANDING, ROLLING, REJECTED, CLIMBING, FINAL, FLARE, ROLL_OUT, STOPPED, AROUND = range(10)
"""Phases."""
NO_REASON, NO_THRUST, OFF_LINE, OFF_SLOPE, BANKED, SINKING, AIRSPEED, TOO_LONG, ASKED = range(9)
"""Why a take-off was rejected, or an approach given up."""

RUNWAY_STATE = np.dtype(
    [
        ("phase", "i8"),
        ("known", "i8"),  # 0: whether it stands is not found out yet
        ("time", "f8"),  # in the phase [s]
        ("doubt", "f8"),  # for how long what ends the phase has been seen [s]
        ("ground", "f8"),  # height of the centre of gravity on the runway [m]
        ("climb_to", "f8"),  # height to which a climb leads, and where on the path it may end [m]
        ("climb_until", "f8"),
        ("line", "f8", (3,)),  # on the ground: a place of it, north, east [m], and its course [rad]
        ("rotating", "f8"),  # for how long it has been rotating [s]
        ("acceleration", "f8"),  # behind a low pass [m/s²]
        ("go_arounds", "i8"),  # made
        ("asked", "i8"),  # 1: a go-around is asked for
        ("waits", "i8"),  # 1: another member of its formation takes off first
        ("reason", "i8"),  # of the last rejection or go-around
        ("leaning", "f8"),  # bank on the final, behind a low pass [rad]
        ("faster", "f8"),  # airspeed commanded beyond the path's on an approach [m/s]
        ("bank_max", "f8"),  # as the ground permits it [rad]; 0: any
        # what is asked for on the ground
        ("heading", "f8"),  # rad
        ("pitch", "f8"),  # rad
        ("thrust", "f8"),  # N
        ("brake", "f8"),  # share
        ("brake_from", "f8"),  # path parameter up to which a landing rolls on [m]
        ("pitch_integral", "f8"),  # rad s
        ("turn_integral", "f8"),  # of the rudder [rad]
    ]
)


@compiled
def on_ground(phase: int) -> bool:
    """Return whether an aircraft is on the ground in a phase."""
    return bool(phase in (STANDING, ROLLING, REJECTED, ROLL_OUT, STOPPED))


@compiled
def is_glide(path: np.void) -> bool:
    """Return whether a path leads to a landing, and has no way around: it is flown to its end."""
    return bool(path["landing"] > 0.0 and path["around"] == 0.0)


@compiled
def enter(state: np.void, phase: int) -> None:
    """Begin a phase."""
    state["phase"] = phase
    state["time"] = state["doubt"] = state["rotating"] = 0.0
    state["pitch_integral"] = state["turn_integral"] = 0.0


@compiled
def gravity_of(now: Situation) -> float:
    """Return the acceleration of gravity [m/s²]."""
    x, y, z = now.motion.gravity
    return math.sqrt(x * x + y * y + z * z)

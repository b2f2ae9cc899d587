"""Real time: for how long an autopilot acted on one state, in simulated time.

Until an autopilot acts on the next state, its aircraft flies by commands made of the last one. The
plant's own step numbers say how long that was: no clock, speed or pause of the simulation has a
part. What they do not show is a full socket, behind which the newest states were lost. The system
counts these.
"""

import numpy as np

from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.native import datagrams_lost

_NONE = -1

STATE_AGE: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = [
    ("acted_step", "i8"),  # step of the state acted on last, -1: none
    ("oldest", "i8", (2,)),  # oldest state acted on in this and the last second [steps]
    ("second_step", "i8"),  # at which this second of simulated time began
    ("lost", "i8"),  # datagrams lost as the socket was full, when last asked
]
"""Fields of a link's state."""


def forget_age(state: np.ndarray) -> None:
    """Begin a flight in which no state was acted on.

    Args:
        state: Of a dtype with the fields `STATE_AGE`, shape (1,), updated in place.
    """
    state["acted_step"] = _NONE
    state["oldest"] = state["second_step"] = 0


@compiled
def note_age(state: np.void, fd: int, step: int, second_steps: int, datagrams: int = 1) -> int:
    """Note that the newest state that was received is acted on now, and the one before no more.

    Args:
        state: Record with the fields `STATE_AGE`, updated in place.
        fd: Socket that all states were taken from.
        step: Step of the state.
        second_steps: Control periods in a second.
        datagrams: How many the plant sends in a step, at least.

    Returns:
        How many steps the plant is ahead of the state, as far as is known.
    """
    before, ahead = state["acted_step"], 0
    if before == _NONE or step > before + 1:
        lost = datagrams_lost(fd)
        if before != _NONE:
            ahead = max(lost - state["lost"], 0) // datagrams
        state["lost"] = lost
    state["acted_step"] = step
    passed = step - state["second_step"]
    if passed >= second_steps:
        state["oldest"][1] = state["oldest"][0] if passed < 2 * second_steps else 0
        state["oldest"][0] = 0
        state["second_step"] = step
    if before != _NONE:
        state["oldest"][0] = max(state["oldest"][0], step - before + ahead)
    return ahead

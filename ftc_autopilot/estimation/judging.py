"""Who is to blame when samples of a sensor go on failing: it, another one, or the filter.

A gate trusts the filter over the world, and the filter may be the one that is wrong. So before a
sensor is excluded, what is independent of the filter is asked: the receiver's place against its own
velocity, the barometer against that, the pitot tube against the lift, and how the innovations of a
magnetometer began.
"""

from typing import Final

import numpy as np

from ftc_autopilot.estimation.airspeed import SHORT, is_stalled, lift_disagrees, says_something
from ftc_autopilot.estimation.health import WELL, is_repeating, is_used
from ftc_autopilot.estimation.receiver import agrees_with_itself, has_moved, is_kept_out
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_VELOCITY
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.runtime.jit import compiled

NOBODY: Final = 0
IT: Final = 1
THE_BAROMETER: Final = 2
THE_FILTER: Final = 3
THE_BIASES: Final = 4
THE_WIND: Final = 5
THE_HEIGHT: Final = 6
THE_OFFSET: Final = 7
"""Of the barometer, which moves as the receiver's velocity says."""

_STEADY = 3000  # samples without silence, before a magnetometer is believed against the gyros
_RAMP = 0.5  # share of doubtful samples before the first that failed


@compiled
def judge(
    s: int,
    sensors: np.ndarray,
    receiver: np.void,
    airspeed: np.void,
    rested: bool,
    assumed: np.void,
) -> int:
    """Return who is to blame for samples that fail: one of the constants above.

    Args:
        s: The sensor whose samples fail.
        sensors: Records of dtype `health.SENSOR`, by number.
        receiver: Record of dtype `receiver.RECEIVER`.
        airspeed: Record of dtype `airspeed.AIRSPEED`.
        rested: Whether the biases have not been doubted for a while.
        assumed: Record of dtype `PARAMETERS`.
    """
    used, coherent = is_used(sensors[s]), agrees_with_itself(receiver)
    if s in (GNSS, GNSS_VELOCITY):
        if coherent:
            return THE_FILTER
        return IT if used else NOBODY
    if s == GNSS_HEIGHT:
        return _of_height(sensors, receiver, used, coherent, assumed)
    if s == BAROMETER:
        if coherent and is_used(sensors[GNSS_HEIGHT]):
            if used and not has_moved(receiver, BAROMETER, assumed):
                return THE_HEIGHT
            if not used and not is_kept_out(receiver, BAROMETER, assumed):
                return THE_OFFSET
        return IT if used else NOBODY
    if not used:
        return NOBODY
    if is_repeating(sensors[s]):
        return IT
    if s == PITOT:
        if not says_something(airspeed, SHORT, assumed):
            return NOBODY
        wrong = lift_disagrees(airspeed, SHORT, assumed) or is_stalled(airspeed, assumed)
        return IT if wrong else THE_WIND
    if sensors[MAGNETOMETER]["steady"] < _STEADY:
        return IT
    if coherent and sensors[GNSS_VELOCITY]["failed"] > 0:
        return THE_FILTER
    # a gyro turns the field away slowly, a magnetometer that is wrong is so at once
    return THE_BIASES if rested and sensors[MAGNETOMETER]["doubt"] > _RAMP else IT


@compiled
def _of_height(
    sensors: np.ndarray, receiver: np.void, used: bool, coherent: bool, assumed: np.void
) -> int:
    if has_moved(receiver, GNSS_HEIGHT, assumed) or not coherent:
        return IT if used else NOBODY
    if has_moved(receiver, BAROMETER, assumed) and sensors[BAROMETER]["reason"] == WELL:
        return THE_BAROMETER
    return THE_HEIGHT

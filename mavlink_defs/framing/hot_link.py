"""Code shared by the compiled loops at both ends of a hot link."""

from enum import IntEnum

import numpy as np

from mavlink_defs.framing.codec import FOREIGN, SIGNED
from mavlink_defs.framing.hot_signing import LinkSigner, verify_frame
from mavlink_defs.runtime.jit import compiled


class ReturnReason(IntEnum):
    """Why a compiled loop returns to Python."""

    NONE = 0  # there is no reason yet
    SERVICE = 1  # a datagram was received that is not hot
    TICK = 2  # the time or the step has come until which the loop should run
    OVER = 3  # the simulation has ended
    LOST = 4  # plant: an aircraft left the model's range of validity
    RESTARTED = 5  # autopilot: the state is of another plant process; the last flight is void
    ADVANCE = 6  # plant: simulators of others are to be advanced by a step


# results of `take` that are no id of a hot message
NOT_HOT = 0  # MAVLink that Python has to parse
DROPPED = -1


@compiled
def take(signer: LinkSigner, datagram: np.ndarray, length: int, drops: np.ndarray) -> int:
    """Verify a received datagram, and count it if it is dropped.

    Args:
        signer: Verifies the link's signatures.
        datagram: Buffer of `codec.new_buffer` with the datagram.
        length: Its length [bytes].
        drops: Datagrams dropped by negated `DropReason`, updated in place.

    Returns:
        The id of a hot message, NOT_HOT or DROPPED.
    """
    code = verify_frame(signer, datagram, length)
    if code in (FOREIGN, SIGNED):
        return NOT_HOT
    if code < 0:
        drops[-code] += 1
        return DROPPED
    return code

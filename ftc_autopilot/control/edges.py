"""What a UAV knows of its neighbours: a record for each edge of the communication graph."""

import numpy as np

from mavlink_defs.framing.codec import NEIGHBOUR
from mavlink_defs.runtime.native import ADDRESS_SIZE

EDGE = np.dtype(
    [
        ("weight", "f8"),  # a_ij in force; 0 while the neighbour is silent
        ("known", NEIGHBOUR),  # what the law goes by: the message, extrapolated if it may be old
        ("message", NEIGHBOUR),  # the one in use
        ("pending", NEIGHBOUR),  # one of a step that is not over here
        ("pending_step", "i8"),  # the step of that
        ("heard_step", "i8"),  # step of the message in use
        ("arrived_step", "i8"),  # that step and how long the message waited to be taken
        ("silent", "i8"),  # 1: it sent no message in the step before
        ("misses", "i8"),  # messages in a row that were waited for in vain
        ("edge", "i8"),  # 1: the neighbour is heard, 0: it is dropped
        ("configured", "f8"),  # a_ij as configured
        ("system", "i8"),  # its system id
        ("address", "u1", (ADDRESS_SIZE,)),  # its sockaddr
    ]
)

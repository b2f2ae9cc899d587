"""The step gate lets simulated time pass up to a step, and no further.

In lockstep the plant waits for the FTC_STEP_DONE of every autopilot. From a given step on, the
gate blocks them. The plant asks again every 50 ms until they pass, so no link times out
meanwhile, commands still work, and the flight continues unchanged.
"""

import math
from collections.abc import Collection

from mavlink_defs import dialect

_DONE = dialect.MAVLink_ftc_step_done_message


class StepGate:
    """The gate of one fleet; closed before the first step.

    Args:
        systems: System ids of its UAVs.
        closed: Whether it is closed at first.
    """

    def __init__(self, systems: Collection[int], closed: bool) -> None:
        self._step = 0 if closed else math.inf
        self._arrived = dict.fromkeys(systems, -1)

    def __call__(self, link: str, direction: str, datagram: bytes) -> bool:
        """Return whether a datagram passes; called for each datagram of the relay."""
        head = dialect.HEADER_LEN_V2
        message_id = int.from_bytes(datagram[7:head], "little")
        if link != "plant" or direction != "to" or message_id != _DONE.id:
            return True
        unpacker = _DONE.unpacker
        payload = datagram[head : head + datagram[1]].ljust(unpacker.size, b"\0")
        step = unpacker.unpack(payload[: unpacker.size])[0]
        if datagram[5] in self._arrived:
            self._arrived[datagram[5]] = step
        return bool(step < self._step)

    def move(self, step: float) -> None:
        """Let every step before this one pass."""
        self._step = step

    def open(self) -> None:
        """Let everything pass from now on."""
        self.move(math.inf)

    @property
    def is_reached(self) -> bool:
        """Whether all UAVs have done the step at which it is closed, so that time has stopped."""
        return all(step >= self._step for step in self._arrived.values())

"""What an ArduPilot's frames say in their order: new ones, repeated ones, losses, a restart.

No socket and no clock: datagrams and the time go in.
"""

from collections import Counter
from enum import Enum

from sitl_plant.foreign.ardupilot.protocol import NotServoPacket, ServoPacket, parse_servo_packet

TAKEOVER_S = 1.0
"""Silence of an ArduPilot after which another address is followed, or a count that is late [s]."""
_LATE = 10
"""Frames by which the count may fall back without a restart: the network held a packet back."""

Address = tuple[str, int]


class Frame(Enum):
    """What a datagram is to the plant."""

    NEW = "the next frame: to be flown and answered"
    REPEATED = "the last frame once more: to be answered again"
    RESTARTED = "the first frame of an ArduPilot that was started again"
    DROPPED = "nothing to follow"


class Peer:
    """One ArduPilot as the plant sees it.

    Attributes:
        address: Where its last frame came from; None before the first.
        packet: Its last frame.
        heard_s: When that came [s, wall time].
        frames: Frames flown.
        repeated: Frames that came again; each was answered again, and not flown.
        missing: Frames that never came: gaps of the count.
        restarts: How often it was started again.
        dropped: Datagrams that were not followed, by reason.
    """

    def __init__(self) -> None:
        self.address: Address | None = None
        self.packet: ServoPacket | None = None
        self.heard_s = 0.0
        self.frames = self.repeated = self.missing = self.restarts = 0
        self.dropped: Counter[str] = Counter()

    def receive(self, datagram: bytes, address: Address, now: float) -> Frame:
        """Take in a datagram.

        Args:
            datagram: As it came.
            address: Where it came from.
            now: Wall-clock time [s].
        """
        try:
            packet = parse_servo_packet(datagram)
        except NotServoPacket as problem:
            return self._drop(str(problem))
        frame = self._frame(packet, address, now)
        if frame is Frame.DROPPED:
            return frame
        self.address, self.packet, self.heard_s = address, packet, now
        if frame is Frame.REPEATED:
            self.repeated += 1
        else:
            self.frames += 1
        return frame

    def _frame(self, packet: ServoPacket, address: Address, now: float) -> Frame:
        if self.packet is None:
            return Frame.NEW
        back = self.packet.frame_count - packet.frame_count
        flies = now - self.heard_s < TAKEOVER_S
        if flies and address != self.address:  # whatever it sends
            return self._drop("another sender than the ArduPilot that flies")
        if back == 0:
            return Frame.REPEATED
        if back < 0:
            self.missing += -back - 1
            return Frame.NEW
        if back <= _LATE and (flies or packet.frame_count > 0):
            return self._drop("late: a newer frame has been flown")
        self.restarts += 1
        return Frame.RESTARTED

    def describe(self) -> str:
        """Say in a line what has come."""
        text = "no frame has come"
        if (last := self.packet) is not None:
            text = f"{self.frames} frames of {len(last.pulses_us)} channels at {last.rate_hz} Hz, "
            text += f"{self.repeated} repeated, {self.missing} missing"
        for reason, count in self.dropped.items():
            text += f"; dropped {count} datagrams: {reason}"
        return text

    def _drop(self, reason: str) -> Frame:
        self.dropped[reason] += 1
        return Frame.DROPPED

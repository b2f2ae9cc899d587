"""PX4's lockstep, seen from its simulator; no socket and no clock: bytes go in and out.

PX4's clock is what the last HIL_SENSOR with id 0 says. At first it has nothing to answer: the
simulator sends frame after frame while PX4 starts (freewheeling). From its first
HIL_ACTUATOR_CONTROLS on, each frame is answered by one, with the frame's time.
"""

from collections import Counter
from enum import Enum

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import ACTUATORS, MessageId
from mavlink_defs.framing.frames import parse
from mavlink_defs.framing.header import HEADER_SIZE, MESSAGE_ID, PAYLOAD_SIZE
from mavlink_defs.framing.stream import FrameStream
from sitl_plant.foreign.px4.instruments import Instruments

LOCKSTEP = 1
"""Bit of HIL_ACTUATOR_CONTROLS.flags: its sender waits for the simulator's time."""

PORT = 4560
"""TCP port of the simulator of PX4's instance 0; instance k connects to the port k higher."""

_DEFAULT_INTERVAL, _NO_INTERVAL = 0, -1


class NotInLockstep(ValueError):  # noqa: N818 - the name says it
    """PX4 does not follow the simulator's clock; the text says why."""


class Turn(Enum):
    """Whose turn it is."""

    FREEWHEELING = "PX4 starts: the simulator sends frame after frame"
    SIMULATOR = "PX4 has answered: the next frame is due"
    PX4 = "a frame is not answered yet"


class Px4Lockstep:
    """One PX4 as its simulator sees it.

    Attributes:
        turn: Whose turn it is.
        time_us: Time of the last frame sent, which is PX4's clock [µs]; 0: none yet.
        controls: Its last answer, dtype `codec.ACTUATORS`; zeros before the first.
        frames: Frames sent.
        answers: Frames answered.
        dropped: Messages that were not followed, by reason.
    """

    def __init__(self, frame_us: int) -> None:
        """Begin before the first frame.

        Args:
            frame_us: Time from frame to frame [µs].
        """
        self._frame_us = frame_us
        self._stream = FrameStream()
        self._truth_every = 0  # frames from truth to truth, 0: it is not sent
        self.turn = Turn.FREEWHEELING
        self.time_us = 0
        self.controls = np.zeros(1, ACTUATORS)[0]
        self.frames = self.answers = 0
        self.dropped: Counter[str] = Counter()

    @property
    def damaged(self) -> int:
        """Bytes that were part of no message."""
        return self._stream.dropped

    def frame(self, instruments: Instruments) -> bytes:
        """Return the next frame, of what the instruments have noted since the last."""
        assert self.turn is not Turn.PX4
        with_truth = self._truth_every > 0 and self.frames % self._truth_every == 0
        self.frames += 1
        self.time_us += self._frame_us
        if self.turn is Turn.SIMULATOR:
            self.turn = Turn.PX4
        return instruments.frame(self.time_us, with_truth=with_truth)

    def receive(self, data: bytes) -> None:
        """Take in what has come from PX4.

        Raises:
            NotInLockstep: It has answered with another time than the simulator's.
        """
        for frame in self._stream.feed(data):
            number = int.from_bytes(frame[MESSAGE_ID:HEADER_SIZE], "little")
            if number == MessageId.ACTUATORS:
                self._take(_controls_in(frame))
            elif number == dialect.MAVLINK_MSG_ID_COMMAND_LONG:
                self._execute(frame)
            elif number != dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self.dropped[f"message {number}, which no simulator follows"] += 1

    def _take(self, controls: np.void) -> None:
        time_us = int(controls["time_usec"])
        if not int(controls["flags"]) & LOCKSTEP:
            raise NotInLockstep("PX4 does not wait for the simulator: it is built without lockstep")
        if time_us > self.time_us:
            raise NotInLockstep(
                f"PX4's clock is at {time_us} us and the simulator's at {self.time_us} us: "
                "another simulator sets it, too"
            )
        if self.turn is Turn.SIMULATOR:  # what was answered is flown, or will be
            self.dropped["a second answer to a frame"] += 1
        elif time_us < self.time_us:
            if self.turn is Turn.FREEWHEELING:  # it may be some frames behind
                self.turn = Turn.PX4
            self.dropped["an answer to an earlier frame"] += 1
        else:
            self.controls = controls
            self.answers += 1
            self.turn = Turn.SIMULATOR

    def _execute(self, frame: bytes) -> None:
        """Follow a request for the truth; what else is commanded is not a simulator's."""
        message = parse(frame)
        interval = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        truth = dialect.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
        if not isinstance(message, dialect.MAVLink_command_long_message) or (
            message.command,
            message.param1,
        ) != (interval, truth):
            self.dropped["a command that no simulator follows"] += 1
        elif message.param2 == _NO_INTERVAL:
            self._truth_every = 0
        elif message.param2 >= _DEFAULT_INTERVAL:
            self._truth_every = max(round(min(message.param2, 1e9) / self._frame_us), 1)


def is_px4(data: bytes) -> bool | None:
    """Return whether a connection's first bytes are PX4's, which begins with a HEARTBEAT.

    None if they may still become so.
    """
    for frame in FrameStream().feed(data):
        message = parse(frame)
        if isinstance(message, dialect.MAVLink_heartbeat_message):
            return bool(message.autopilot == dialect.MAV_AUTOPILOT_PX4)
    return None if len(data) < _MOST_BEFORE_HEARTBEAT else False


_MOST_BEFORE_HEARTBEAT = 1024  # bytes; PX4 sends its request for the truth, at most


def _controls_in(frame: bytes) -> np.void:
    """Return the payload of an HIL_ACTUATOR_CONTROLS, whose zeros at the end are not sent."""
    payload = frame[HEADER_SIZE : HEADER_SIZE + frame[PAYLOAD_SIZE]][: ACTUATORS.itemsize]
    record: np.void = np.frombuffer(payload.ljust(ACTUATORS.itemsize, b"\0"), ACTUATORS)[0]
    return record

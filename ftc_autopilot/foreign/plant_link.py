"""A bridge's end of the simulator link: what the plant sends, and what it is sent.

No socket and no clock: datagrams go in and out.
"""

from collections import Counter

import numpy as np

from ftc_autopilot.foreign.base import PlantStep
from mavlink_defs import dialect
from mavlink_defs.constants import N_CHANNELS, SIMULATOR_COMPONENT
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, frame_size, parse
from mavlink_defs.framing.header import (
    COMPONENT,
    HEADER_SIZE,
    MESSAGE_ID,
    PAYLOAD_SIZE,
    SYSTEM,
)
from mavlink_defs.framing.signing import Signer

_FORMS: dict[int, np.dtype] = {
    codec.MessageId.SIM_STATE: codec.SIM_STATE,
    codec.MessageId.SIM_STEP: codec.SIM_STEP,
    codec.MessageId.SENSOR: codec.HIL_SENSOR,
    codec.MessageId.GPS: codec.HIL_GPS,
}
_PATIENCE_US = 50_000
"""Real time: a message that the plant does not show for so long [µs] is sent again."""
_NO_INTERVAL = 2**32 - 1
_NOTHING = 2**64 - 1  # FTC_SIM_STATE.actuator_time_usec before the first actuator message


class PlantSide:
    """One aircraft's link to the plant.

    Attributes:
        step: The last step, as the plant sent it; None before the first.
        flags: FTC_SIM_FLAGS of that.
        is_repeated: Whether the plant has sent that step before.
        restarted: Whether a state of another plant process has come.
        drops: Datagrams dropped, by reason.
        events: Commands sent because they changed, by channel, shape (4,).
        messages: Messages with them.
        repeats: Messages sent again, as the plant had not got them, of each channel.
    """

    def __init__(self, system: int, signer: Signer | None) -> None:
        """Begin without a state.

        Args:
            system: System id of the UAV.
            signer: Signs and checks the link; None: it is not signed.
        """
        self._system, self._signer = system, signer
        self._packer = FramePacker(system, dialect.MAV_COMP_ID_AUTOPILOT1)
        self.step: PlantStep | None = None
        self.flags = 0
        self.is_repeated = self.restarted = False
        self.drops: Counter[DropReason] = Counter()
        self.events = np.zeros(N_CHANNELS, np.int64)
        self.messages = 0
        self.repeats = np.zeros(N_CHANNELS, np.int64)
        self._run: int | None = None
        self._flown: int | None = None  # the last step of which time ran
        self._applied_us: int | None = None
        self._shares: np.ndarray | None = None
        self._controls = [0.0] * 16
        self._sent_us, self._sent_mask = -1, 0
        self._sensors: list[np.void] = []
        self._gps: np.void | None = None

    def receive(self, datagram: bytes) -> MAVLink_message | None:
        """Take in a datagram; `step` is what it completes, if `took_step` says so.

        Returns:
            A message that is neither a state nor a sensor's; None of one that is, or is dropped.
        """
        self.took_step = False
        problem = self._problem(datagram)
        if problem is not None:
            self.drops[problem] += 1
            return None
        number = int.from_bytes(datagram[MESSAGE_ID:HEADER_SIZE], "little")
        form = _FORMS.get(number)
        if form is None:
            message = parse(datagram)
            if message is None:
                self.drops[drop_reason(datagram)] += 1
            return message
        size = datagram[PAYLOAD_SIZE]
        payload = datagram[HEADER_SIZE : HEADER_SIZE + size][: form.itemsize]
        record = np.frombuffer(payload.ljust(form.itemsize, b"\0"), form)[0]
        if number == codec.MessageId.SENSOR:
            self._sensors.append(record)
        elif number == codec.MessageId.GPS:
            self._gps = record
        else:
            self._note_step(record, number == codec.MessageId.SIM_STATE)
        return None

    took_step = False
    """Whether the last datagram was a step of the plant."""

    def _problem(self, datagram: bytes) -> DropReason | None:
        if self._signer is not None:
            problem = self._signer.problem(datagram)
        else:
            size, problem = frame_size(datagram)
            if problem is None and size != len(datagram):
                problem = DropReason.BAD_LENGTH
        if problem is None and (datagram[SYSTEM], datagram[COMPONENT]) != (
            self._system,
            SIMULATOR_COMPONENT,
        ):
            problem = DropReason.STRANGER
        return problem

    def _note_step(self, record: np.void, is_state: bool) -> None:
        run, number = int(record["run"]), int(record["step"])
        self.restarted |= self._run is not None and run != self._run
        self._run, self.flags = run, int(record["flags"])
        self.is_repeated = self.is_running and number == self._flown
        self._flown = number if self.is_running else None
        applied = int(record["actuator_time_usec"])
        self._applied_us = None if applied == _NOTHING else applied
        sensors, gps = tuple(self._sensors), self._gps
        self._sensors, self._gps = [], None
        time_us = int(record["time_usec"])
        self.step = PlantStep(number, time_us, record if is_state else None, sensors, gps)
        self.took_step = True

    @property
    def is_running(self) -> bool:
        """Whether simulated time runs."""
        return bool(self.flags & dialect.FTC_SIM_FLAGS_RUNNING)

    @property
    def is_lockstep(self) -> bool:
        """Whether the plant waits for `done`."""
        return bool(self.flags & dialect.FTC_SIM_FLAGS_LOCKSTEP)

    @property
    def is_over(self) -> bool:
        """Whether the simulation has ended."""
        return bool(self.flags & dialect.FTC_SIM_FLAGS_ENDED)

    def command(self, shares: np.ndarray) -> tuple[int, bytes | None]:
        """Return the mask of the channels that have changed, and what the plant is sent.

        That is nothing if none has, and the plant has got all that was sent before.

        Args:
            shares: Of the four channels at this step, float32.
        """
        assert self.step is not None
        before = self._shares
        changed = np.ones(N_CHANNELS, bool) if before is None else shares != before
        mask = sum(1 << int(c) for c in np.flatnonzero(changed))
        patience_us = 0 if self.is_lockstep else _PATIENCE_US
        overdue = self._is_pending and self.step.time_us - self._sent_us > patience_us
        if not mask and not overdue:
            return 0, None
        if mask:
            self._shares = shares.copy()
            self.events += changed
            self.messages += 1
        else:  # a repeat, as the plant does not know of the last
            self.repeats += [self._sent_mask >> c & 1 for c in range(N_CHANNELS)]
        self._sent_us, self._sent_mask = self.step.time_us, mask or self._sent_mask
        self._controls[:N_CHANNELS] = shares.tolist()
        return mask, self._pack(self._actuators())

    @property
    def _is_pending(self) -> bool:
        """Whether the plant has not shown that it has what was sent last."""
        applied_us = -1 if self._applied_us is None else self._applied_us
        return applied_us < self._sent_us

    def again(self) -> list[bytes]:
        """Return what the plant is sent when it sends a step once more: something was lost."""
        frames = []
        if self._is_pending:
            frames.append(self._pack(self._actuators()))
        return [*frames, self.done()]

    def counts(self) -> MAVLink_message:
        """Return FTC_EVENTS so far."""
        time_us, steps = (0, 0) if self.step is None else (self.step.time_us, self.step.step + 1)
        return dialect.MAVLink_ftc_events_message(
            time_boot_ms=time_us // 1000 & 0xFFFFFFFF,
            steps=steps if self.is_running else 0,
            events=self.events.tolist(),
            min_interval_us=[_NO_INTERVAL] * N_CHANNELS,
            messages=self.messages,
            repeats=self.repeats.tolist(),
            edge_changes=0,
        )

    def done(self) -> bytes:
        """Return the message that this step is finished; nothing was sent to neighbours."""
        assert self.step is not None
        return self._pack(dialect.MAVLink_ftc_step_done_message(self.step.step, 1))

    def pack(self, message: MAVLink_message) -> bytes:
        """Return the frame of another message to the plant."""
        return self._pack(message)

    def _actuators(self) -> MAVLink_message:
        return dialect.MAVLink_hil_actuator_controls_message(self._sent_us, self._controls, 0, 0)

    def _pack(self, message: MAVLink_message) -> bytes:
        frame = self._packer.pack(message)
        return frame if self._signer is None else self._signer.sign(frame)

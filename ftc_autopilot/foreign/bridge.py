"""The bridge process of one UAV that a foreign autopilot flies: ``ftc-autopilot CONFIG``.

To the plant it is an autopilot as ours is: it registers by HEARTBEAT, is sent the state of each
step, sends HIL_ACTUATOR_CONTROLS when an output has changed, and FTC_STEP_DONE. On its other side
it starts the autopilot's program, speaks its simulator protocol, and passes its MAVLink on.
"""

import contextlib
import select
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.arduplane import ArduPlane
from ftc_autopilot.foreign.base import ForeignAutopilot, ForeignError, ForeignInputError
from ftc_autopilot.foreign.plant_link import PlantSide
from ftc_autopilot.foreign.px4_plane import Px4Plane
from ftc_autopilot.foreign.recorder import ForeignRecorder
from ftc_autopilot.foreign.sensor_faults import SensorFaults
from ftc_autopilot.foreign.slot import SlotKeeper
from ftc_autopilot.foreign.sockets import BridgeSockets, waiting_in
from ftc_autopilot.foreign.vehicle import ForeignVehicle
from ftc_autopilot.kinds import FtcAutopilot
from ftc_autopilot.vehicle.gcs_signing import GcsSigning
from mavlink_defs import dialect
from mavlink_defs.constants import MAX_DATAGRAM
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import FORMATION_LINK, PLANT_LINK, Signer, counts_text, open_time
from mavlink_defs.visible import log_line

FOREIGN: dict[str, Callable[[AutopilotConfig, UdpAddress], ForeignAutopilot]] = {
    "ardupilot": ArduPlane,
    "px4": Px4Plane,
}
"""What flies by each `kind` of `uavs[].autopilot`."""

_TICK_S = 0.02
_TURN_S = 0.005  # between two looks at the other links while the plant's time runs
_HEARTBEAT_S, _REGISTER_S = 1.0, 0.2
_COUNT_S = 0.5
_TAKEOVER_S = 3.0  # of silence, before one that is started by hand may be another one
_IN_LOCKSTEP = "a foreign autopilot is started again in lockstep only"


class Bridge:
    """Sockets and clock around one foreign autopilot.

    Attributes:
        stopping: Set to end it.
        loss: Why it ended before the simulation did; None if it did not.
        failure: How the autopilot has ended the flight; None if it has not.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        record: Path | None,
        record_optional: bool,
        sockets: contextlib.ExitStack,
        checkpoint: Path | None = None,
    ) -> None:
        """Open the links; what is opened is closed with `sockets`.

        Args:
            config: Its configuration.
            record: Where it records; None: it does not.
            record_optional: Fly on if that cannot be written.
            sockets: Closes them.
            checkpoint: Where it keeps what one that is started again needs; None: it is not.

        Raises:
            EndpointError, SigningError: A link cannot be used.
            OSError: A file cannot be made; it is named.
        """
        self._config = config
        self.stopping = False
        self.loss: str | None = None
        self.failure: str | None = None
        key = config.signing_key
        keys = None if key is None else (KeyFile(key, self._log).at, open_time(key))
        links = PLANT_LINK, FORMATION_LINK
        shared, formed = (None if keys is None else Signer(*keys, link) for link in links)
        self._link = PlantSide(config.id, shared)
        self._signing = GcsSigning(config.id, key)
        self._sockets = BridgeSockets(config, sockets)
        self._slot = None if config.formation is None else SlotKeeper(config, formed)
        self._recorder = ForeignRecorder(
            config,
            record,
            record_optional,
            self._log,
            resumes=checkpoint is not None and checkpoint.exists(),
        )
        self._peer: tuple[str, int] | None = None  # where the autopilot's MAVLink comes from
        self._peer_s = 0.0  # when it came last
        assert not isinstance(config.autopilot, FtcAutopilot)
        self._autopilot = FOREIGN[config.autopilot.kind](config, self._sockets.mavlink)
        sockets.callback(self._autopilot.close)
        faults = SensorFaults(self._autopilot.failures, config.autopilot.refuses, self._time_s)
        order = None if self._slot is None else self._slot.order
        self._new_vehicle = partial(
            ForeignVehicle, config.id, config.origin, self._link.counts, faults, checkpoint, order
        )
        self._vehicle = self._new_vehicle()
        self._saves = checkpoint is not None
        self._armed = self._over = False
        self._heard_s = time.monotonic()
        self._due_s = self._count_due_s = self._turn_due_s = 0.0
        self._steps = 0
        self._flown: int | None = None  # the last step that it has flown

    def _time_s(self) -> float:
        """Return the simulation time [s]."""
        return 0.0 if self._link.step is None else self._link.step.time_us / 1e6

    def fly(self) -> None:
        """Serve all links until the simulation is over, or `stopping` is set.

        Raises:
            ForeignInputError: The autopilot cannot be started.
        """
        try:
            while not (self.stopping or self._over):
                if not self._armed and self._link.step is not None:
                    self._hold()
                self._wait_for_plant()
                self._serve(time.monotonic())
                self._check_plant()
        except ForeignInputError:
            raise
        except ForeignError as problem:
            if not self.stopping:
                self._fail(str(problem))
        self._autopilot.close()

    def _fail(self, why: str) -> None:
        """End the flight, as the autopilot cannot fly on; before it, as the bridge cannot."""
        self._vehicle.say(dialect.MAV_SEVERITY_CRITICAL, why)
        self._send_to_stations()
        goes_on = self._saves and self._link.is_lockstep
        if self._link.is_running and not goes_on:
            self.failure = f"{why}; {_IN_LOCKSTEP}" if self._saves else why
        else:
            self.loss = why

    def finish(self) -> int:
        """Write the end of the record; return the exit status, as of `ftc_autopilot.process`.

        There is no record of a flight that did not begin, and no end of one that goes on with the
        next bridge.
        """
        self._take_notices()
        goes_on = self.loss is not None and self._saves and not self._link.is_over
        if goes_on:
            self._recorder.flush()
        elif self._steps or self.loss is None:
            unwritable = self._recorder.finish(
                self.loss, self._link.repeats.tolist(), self._link.is_over, self.failure
            )
            self.loss = self.loss or unwritable
        drops = Counter({reason.text: n for reason, n in self._link.drops.items()})
        if drops:
            self._log(f"frames dropped: {counts_text(drops)}")
        if self.failure is not None or self.loss is not None:
            self._log(self.failure or self.loss or "")
        return 3 if self.failure is not None else int(self.loss is not None)

    _began = False

    def _hold(self) -> None:
        """Let the autopilot's own clock run, before the plant's does."""
        step = self._link.step
        assert step is not None
        if not self._began:
            if self._link.is_running and not self._link.is_lockstep:
                raise ForeignError(f"the flight is under way: {_IN_LOCKSTEP}")
            self._began = True
            self._autopilot.begin(step)
        self._armed = self._autopilot.hold(self)
        if self._armed:
            self._due_s = 0.0  # the plant is to know it now
            if self._link.is_running:
                self._fly_step()

    @property
    def is_ready(self) -> bool:
        """Whether it can be armed; one that is started again is when it has been given all."""
        return self._vehicle.is_shown and not self._vehicle.resumption.resumes

    @property
    def is_armed(self) -> bool:
        """Whether it is armed."""
        return self._vehicle.is_armed

    def release(self) -> float:
        """Let one message of a station through; return how long its answer takes [s]."""
        return self._vehicle.release()

    def exchange(self, time_s: float) -> None:
        """Take in what the autopilot has sent, and send what waits, at a time of its clock [s]."""
        for datagram, sender in waiting_in(self._sockets.side):
            now = time.monotonic()
            if sender != self._peer and not self._follow(now):
                self._link.drops[DropReason.STRANGER] += 1
                continue
            self._peer, self._peer_s = sender, now
            self._vehicle.receive(datagram, time_s)
        if (refusal := self._vehicle.resumption.refusal) is not None:
            raise ForeignError(refusal)
        if self._peer is not None:
            for frame in self._vehicle.to_autopilot(time_s):
                self._sockets.to_autopilot(frame, self._peer)

    def _wait_for_plant(self) -> None:
        """Take in what the plant sends; while its time stands still, only what has come."""
        waits = self._armed or self._link.step is None
        self._sockets.plant.settimeout(_TICK_S if waits else 1e-4)
        while not self._over:
            try:
                datagram = self._sockets.plant.recv(MAX_DATAGRAM)
            except OSError:  # none came, or nobody listens yet
                return
            self._heard_s = time.monotonic()
            message = self._link.receive(datagram)
            if message is not None:
                self._vehicle.receive_from_plant(message, self._heard_s)
            elif self._link.took_step and not self._is_overtaken():
                self._answer()
                self._heard_s = time.monotonic()  # what came meanwhile waits in the socket
            if not (self._link.is_running and self._armed) or self._heard_s >= self._turn_due_s:
                return

    def _is_overtaken(self) -> bool:
        """Return whether a newer state has come already, in real time."""
        waits = self._link.is_lockstep or self._link.is_over or not self._link.is_running
        return not waits and bool(select.select([self._sockets.plant], [], [], 0.0)[0])

    def _answer(self) -> None:
        """Answer the plant's step."""
        link = self._link
        if link.restarted:
            raise ForeignError("the plant was started again: start the flight again")
        if link.is_over:
            self._over = True
            self._sockets.to_plant(link.done())
        elif not (link.is_running and self._armed):
            return  # the plant waits for it
        elif link.is_repeated and link.step is not None and link.step.step == self._flown:
            for frame in link.again() if link.is_lockstep else ():
                self._sockets.to_plant(frame)
        else:
            self._fly_step()

    def _fly_step(self) -> None:
        link, step = self._link, self._link.step
        assert step is not None
        self._flown = step.step
        if self._slot is not None and self._peer is not None:
            self._hear_neighbours()
            self._slot.plan(self._vehicle.resumption.mission)
            for message in self._slot.targets(step, link.is_lockstep):
                self._sockets.to_autopilot(self._vehicle.packed(message), self._peer)
        shares = self._autopilot.exchange(step)
        mask, frame = link.command(shares)
        self._steps += 1
        self._recorder.add(step, shares, mask, self._slot.place if self._slot else None)
        if frame is not None:
            self._sockets.to_plant(frame)
        if link.is_lockstep:
            self._sockets.to_plant(link.done())

    def _hear_neighbours(self) -> None:
        """Take in what ours say: before the flight, too, or it would fill the socket."""
        for datagram, _ in waiting_in(self._sockets.formation):
            if self._slot is not None and (problem := self._slot.receive(datagram)) is not None:
                self._link.drops[problem] += 1

    def _serve(self, now: float) -> None:
        """Do what is due on the links to the autopilot, the stations and the plant."""
        if self._link.is_running and now < self._turn_due_s:
            return
        self._turn_due_s = now + _TURN_S
        self._receive_from_stations(now)
        self._hear_neighbours()
        if self._armed:  # before, its clock runs in `hold`
            while self._vehicle.release():
                pass
            self.exchange(now)
        self._vehicle.handle_timer(now)
        self._take_notices()
        running = self._link.is_running
        if now >= self._due_s:
            self._due_s = now + (_REGISTER_S if self._link.step is None else _HEARTBEAT_S)
            self._sockets.to_plant(self._link.pack(self._registration()))
        if running and now >= self._count_due_s:
            self._count_due_s = now + _COUNT_S
            self._vehicle.count()
        for message in self._vehicle.to_plant():
            self._sockets.to_plant(self._link.pack(message))
        self._send_to_stations()

    def _registration(self) -> dialect.MAVLink_message:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
        status = dialect.MAV_STATE_ACTIVE if armed else dialect.MAV_STATE_STANDBY
        kind, autopilot = dialect.MAV_TYPE_FIXED_WING, dialect.MAV_AUTOPILOT_GENERIC
        return dialect.MAVLink_heartbeat_message(kind, autopilot, armed, 0, status, 3)

    def _take_notices(self) -> None:
        """Show stations, and the log, what the operator should know."""
        while self._autopilot.notices:
            text = self._autopilot.notices.pop(0)
            self._log(text)
            self._vehicle.say(dialect.MAV_SEVERITY_NOTICE, text)

    def _follow(self, now: float) -> bool:
        """Return whether another sender may be the autopilot, which has one socket: once.

        One that is started by hand may be started again before the flight.
        """
        if self._peer is None:
            return True
        if not self._sockets.is_by_hand or self._armed or now - self._peer_s < _TAKEOVER_S:
            return False
        self._vehicle = self._new_vehicle()
        return True

    def _receive_from_stations(self, now: float) -> None:
        for datagram, sender in waiting_in(self._sockets.gcs):
            if sender not in self._sockets.stations:
                continue
            message = self._signing.accept(datagram)
            if isinstance(message, DropReason):
                self._link.drops[message] += 1
            elif isinstance(message, dialect.MAVLink_setup_signing_message):
                text = self._signing.set_key(message, sender[0], self._armed)
                if text is not None:
                    self._vehicle.say(dialect.MAV_SEVERITY_WARNING, text)
            else:
                station = self._sockets.stations.index(sender)
                self._vehicle.receive_from_station(message, now, station)

    def _send_to_stations(self) -> None:
        for frame in self._vehicle.to_stations():
            self._sockets.to_stations(self._signing.sign(frame))

    def _check_plant(self) -> None:
        """End if the plant has fallen silent."""
        limit_s = self._config.silence_timeout_s
        if self._link.step is None or time.monotonic() - self._heard_s <= limit_s:
            return
        at_s = self._link.step.time_us / 1e6
        self.loss = f"the plant has been silent for {limit_s:g} s at {at_s:.3f} s"
        self._over = True

    def _log(self, text: str) -> None:
        with contextlib.suppress(OSError):  # a full disk must not end the flight
            log_line(f"ftc-autopilot {self._config.id}: {text}")

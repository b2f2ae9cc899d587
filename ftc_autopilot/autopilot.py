"""One autopilot: its sockets and the wall clock, around the compiled loop and the services."""

import contextlib
import os
import signal
import socket
import time
from collections import Counter
from pathlib import Path

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.plugin_failures import clear_failures, failure_of
from ftc_autopilot.hot.checkpoint import save
from ftc_autopilot.hot.drops import GCS, PLANT, SIMULATOR
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.navigation import reset_navigation
from ftc_autopilot.hot.recorder import AutopilotRecorder
from ftc_autopilot.hot.state import FORMATION_SIGNER, PLANT_SIGNER, Autopilots
from ftc_autopilot.vehicle.gcs_signing import GcsSigning
from ftc_autopilot.vehicle.mission_checkpoint import load_mission, save_mission
from ftc_autopilot.vehicle.vehicle import VehicleServices
from mavlink_defs import dialect
from mavlink_defs.constants import SIMULATOR_COMPONENT
from mavlink_defs.endpoint import parse_address, resolve, set_receive_timeout
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, parse
from mavlink_defs.framing.header import MAX_FRAME_SIZE
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.framing.hot_signing import refresh, sign_bytes
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.runtime.spool import unwritten
from mavlink_defs.visible import log_line

_NEVER = 2**62
_TICK_S = 0.02
_LOCKSTEP_TURN_US = 100_000
"""Lockstep: telemetry is made at multiples of this time of its clock, or of a shorter one [µs]."""
_LOCKSTEP_WAIT_S = 0.5
"""Lockstep: longest time between two turns to the services [s]."""
_MAX_AT_ONCE = 32
"""Real time: most messages to a ground station after steps that were missed."""
_MAX_GCS_DATAGRAMS = 8
"""Most datagrams of ground stations handled at a time while no control step can be late."""
_TURN_US = 20_000
"""Lockstep: messages are handled at multiples of this simulated time [µs]."""


class Autopilot:
    """Sockets and wall clock around the compiled loop and the services.

    Attributes:
        system: Its system id.
        state: Its state, which the compiled loop shares.
        is_over: Whether its flight has ended, or it was stopped.
        loss: Why it ended before the simulation did; None if it did not.
        failure: Which plug-in has ended it and why; None if none has.
        crash_at: Step after which to exit, as by SIGKILL: for tests.
        record_optional: Whether to fly on if the record cannot be written, and without control if
            a plug-in fails.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        state: Autopilots,
        plant: socket.socket,
        formation: socket.socket,
        gcs: socket.socket,
        record: Path | None,
        key_file: KeyFile | None,
        mission_file: Path | None = None,
        resumes: bool = False,
    ) -> None:
        """Boot, resuming the flight of a previous process if there is one.

        Args:
            config: The configuration.
            state: A single one of `new_autopilots`.
            plant: Connected to the plant.
            formation: Bound to the own formation port.
            gcs: Sends to the ground stations.
            record: Folder for the recorded signals; None: nothing is recorded.
            key_file: The file `config.signing_key`, opened before the sockets were bound; None
                without one.
            mission_file: Where the mission is saved for a restart; None: it is not.
            resumes: Whether `state` was restored from a checkpoint.

        Raises:
            OSError: A file cannot be made; it is named.
        """
        self._config, self.system = config, config.id
        self._plant, self._formation, self._gcs = plant, formation, gcs
        set_receive_timeout(formation, _TICK_S)
        gcs.setblocking(False)
        addresses = [resolve(parse_address(text)) for text in config.gcs]
        self._ground_stations = [(address.host, address.port) for address in addresses]
        self._simulator = (config.id, SIMULATOR_COMPONENT)
        self._key_file = key_file
        self.state, self._saved = state, state.own[0]["vehicle"]
        self._controllers = state.controllers
        self._signers = [state.signer(0, link) for link in (PLANT_SIGNER, FORMATION_SIGNER)]
        self._recorder = None if record is None else AutopilotRecorder(state, record, resumes)
        self._hot = HotState(state)
        self._vehicle = VehicleServices(config, self._hot, self._controllers, time.time())
        self._mission_file = mission_file
        if resumes and mission_file:
            self._vehicle.resume(self._saved, load_mission(mission_file))
        self._saved_mission: int | None = None
        component = dialect.MAV_COMP_ID_AUTOPILOT1
        # each has its own sequence numbers: not all get the same messages
        self._to_gcs = [FramePacker(config.id, component) for _ in config.gcs]
        self._most_per_step = self._vehicle.most_per_step(config.step_us)
        self._served_step = 0  # after which messages were handled last
        self._more_to_do = False
        self._gcs_signing = GcsSigning(config.id, config.signing_key)
        self._to_plant = FramePacker(config.id, component, self._next_sequence)
        self.loss: str | None = None
        self.failure: str | None = None
        self.is_over = False
        self.crash_at = _NEVER
        self.record_optional = False

    @property
    def sockets(self) -> tuple[int, int, int]:
        """File descriptors of the sockets, as of `ftc_autopilot.hot.loop.new_loops`."""
        return self._plant.fileno(), self._formation.fileno(), self._gcs.fileno()

    def serve(self, outcome: ReturnReason) -> None:
        """Do what the compiled loop asks for, and serve all links; it may be the end.

        Args:
            outcome: Why the loop returned.
        """
        if self._hot.step >= self.crash_at:
            os.kill(os.getpid(), signal.SIGKILL)
        self.loss = self._write_record(outcome == ReturnReason.RESTARTED) or self._failure()
        if self.loss is None and outcome == ReturnReason.OVER:
            self._report_end()
            self.stop()
            return
        if outcome == ReturnReason.SERVICE:
            self._receive_from_simulator()
        elif outcome == ReturnReason.RESTARTED:
            self._vehicle.restart()
            reset_navigation(self.state.own, self.state.histories, self._config)
        self.loss = self.loss or self._silence()
        if self.loss is None:
            self._handle_messages()
        else:
            self._vehicle.farewell(self.loss)
            self.stop()

    def _report_end(self) -> None:
        """Report to ground stations how the simulation ended, as far as this aircraft knows."""
        time_s, severity = self._hot.time_s, dialect.MAV_SEVERITY_NOTICE
        lost = self._hot.flags & dialect.FTC_SIM_FLAGS_LOST
        text = f"simulation {'lost' if lost else 'over'} at {time_s:.3f} s"
        if lost and self._hot.measured["position"][2] > 0.0:
            text, severity = f"hit the ground at {time_s:.3f} s", dialect.MAV_SEVERITY_CRITICAL
        self._vehicle.farewell(text, severity)

    def stop(self) -> None:
        """Send the last messages; the flight is over."""
        self.is_over = True
        self._send_messages()

    def finish_record(self) -> None:
        """Write the end of the record; `loss` says if it cannot be written."""
        heard_end = bool(self._hot.flags & dialect.FTC_SIM_FLAGS_ENDED)
        try:
            if self._recorder is not None:
                repeated, failure = self._hot.repeated, self.failure
                self._recorder.finish(self.loss, repeated, heard_end, failure)
        except Exception as problem:
            if not (self.record_optional or isinstance(problem, OSError)):
                raise
            if not self.record_optional:
                self.loss = unwritten(problem)

    def _write_record(self, restarted: bool) -> str | None:
        """Write the record if it is full; return why it cannot be written."""
        try:
            if self._recorder is not None and restarted:
                self._recorder.restart()
            elif self._recorder is not None:
                self._recorder.write()
        except Exception as problem:
            if self._recorder is None or not (self.record_optional or isinstance(problem, OSError)):
                raise
            if not self.record_optional:
                return unwritten(problem)
            self._recorder.give_up()
            log(self.system, f"{unwritten(problem)}; flying on without recording")
        return None

    def _failure(self) -> str | None:
        """Return how a plug-in has ended the flight; a standing fleet flies on without this one."""
        failure = failure_of(self._controllers.uavs[0], self._config, self._hot.time_s)
        if failure is None:
            return None
        log(self.system, failure)
        if not self.record_optional:
            self.failure = failure
            return failure
        clear_failures(self._controllers.uavs[0])
        self._vehicle.end_control(failure)
        return None

    def refused(self) -> Counter[str]:
        """Return the datagrams dropped on all links, by reason."""
        drops = self._hot.drops[:PLANT].sum(axis=0)
        return +Counter({reason.text: int(drops[-reason]) for reason in DropReason})

    def _next_sequence(self) -> int:
        self._hot.sequence += 1
        return self._hot.sequence - 1

    def _handle_messages(self) -> None:
        """Receive from ground stations and answer; in real time a few messages for each step."""
        if self._key_file is not None:
            refresh(self._key_file, *self._signers)
        passed, self._served_step = self._hot.step - self._served_step, self._hot.step
        most = None
        if self._in_real_time:
            most = min(self._most_per_step * max(passed, 1), _MAX_AT_ONCE)
        more = True
        if not self._vehicle.has_gcs_messages:  # answer earlier requests first
            more = self._receive_from_ground_stations(most or _MAX_GCS_DATAGRAMS)
        self._vehicle.handle_timer(time.monotonic(), most)
        self._save_mission()
        self._vehicle.save(self._saved)
        save(self.state.checkpoint, self.state.own, self.state.edges)
        self._send_messages(most)
        self._more_to_do = more or self._vehicle.has_gcs_messages

    def _save_mission(self) -> None:
        """Write the mission if it has changed; the flight goes on if it cannot be written."""
        if self._mission_file is None:
            return
        number, mission = self._vehicle.mission_checkpoint()
        if number == self._saved_mission:
            return
        self._saved_mission = number
        try:
            save_mission(self._mission_file, mission)
        except OSError as problem:
            text = f"cannot save the mission for a restart: {problem.strerror}"
            self._vehicle.say(dialect.MAV_SEVERITY_WARNING, text)

    def until_s(self) -> float:
        """Return the wall-clock time at which messages are to be handled [s].

        In lockstep all vehicles wait while one does so. So all do so at the same times, which come
        as often as their fastest stream, and send together what is due.
        """
        now, deadline = time.monotonic(), self._vehicle.deadline()
        if not self._vehicle.telemetry_clock.is_slower_of_both:
            return min(now + _TICK_S, deadline)
        intervals_us = (one.shortest_interval_us() for one in self._vehicle.telemetry)
        turn_us = min(_LOCKSTEP_TURN_US, *intervals_us)
        due_us = -(-self._vehicle.next_telemetry_us() // turn_us) * turn_us
        wait_s = self._vehicle.telemetry_clock.wait_s(due_us)
        return min(now + min(wait_s, _LOCKSTEP_WAIT_S), deadline)

    def until_step(self) -> int:
        """Return the step after which messages are to be handled."""
        if not self._hot.running:
            return self.crash_at
        if self._more_to_do:
            return self._hot.step + 1
        watched = min(self._vehicle.next_check_step(), self.crash_at)
        if self._vehicle.telemetry_clock.is_slower_of_both:
            return watched  # turns come by the wall clock
        due_us = self._vehicle.next_telemetry_us()
        if not self._in_real_time:  # no deadline in lockstep: fewer turns
            due_us = -(-due_us // _TURN_US) * _TURN_US
        return min(-(-due_us // self._config.step_us), watched)

    @property
    def _in_real_time(self) -> bool:
        """Whether simulated time runs by the clock, so that a control step can be late."""
        running, lockstep = dialect.FTC_SIM_FLAGS_RUNNING, dialect.FTC_SIM_FLAGS_LOCKSTEP
        return bool(self._hot.flags & (running | lockstep) == running)

    def _silence(self) -> str | None:
        heard_s = self._hot.heard_s
        limit_s = self._config.silence_timeout_s
        silent = heard_s > 0.0 and time.monotonic() - heard_s > limit_s
        if silent and not _waits(self._plant):  # or this process had no time to hear it
            return f"the plant has been silent for {limit_s:g} s at {self._hot.time_s:.3f} s"
        return None

    def _receive_from_simulator(self) -> None:
        datagram = self._hot.received()
        message = parse(datagram)
        if message is None:
            self._hot.drops[SIMULATOR, -drop_reason(datagram)] += 1
        elif (message.get_srcSystem(), message.get_srcComponent()) != self._simulator:
            self._hot.drops[SIMULATOR, -DropReason.STRANGER] += 1
        else:
            if self._hot.heard_s > 0.0:  # in lockstep there is no state while others restart
                self._hot.heard_s = time.monotonic()
            self._vehicle.receive_from_simulator(message, time.monotonic())

    def _receive_from_ground_stations(self, most: int) -> bool:
        """Handle at most `most` datagrams of ground stations; return whether more may wait."""
        for _ in range(most):
            try:
                datagram, sender = self._gcs.recvfrom(MAX_FRAME_SIZE + 1)
            except (BlockingIOError, ConnectionRefusedError):
                return False
            if sender not in self._ground_stations:
                self._hot.drops[GCS, -DropReason.STRANGER] += 1
                continue
            message = self._gcs_signing.accept(datagram)
            if isinstance(message, DropReason):
                self._hot.drops[GCS, -message] += 1
            elif isinstance(message, dialect.MAVLink_setup_signing_message):
                text = self._gcs_signing.set_key(message, sender[0], self._vehicle.modes.armed)
                if text is not None:
                    self._vehicle.say(dialect.MAV_SEVERITY_WARNING, text)
            else:
                station = self._ground_stations.index(sender)
                self._vehicle.receive(message, time.monotonic(), station)
        return True

    def _send_messages(self, most: int | None = None) -> None:
        for message in self._vehicle.simulator_messages():
            _send(
                self._plant, sign_bytes(self._signers[PLANT_SIGNER], self._to_plant.pack(message))
            )
        for station, address in enumerate(self._ground_stations):
            for message in self._vehicle.gcs_messages(station, most):
                frame = self._gcs_signing.sign(self._to_gcs[station].pack(message))
                _send(self._gcs, frame, address)


def _send(sock: socket.socket, frame: bytes, address: tuple[str, int] | None = None) -> None:
    """Send a frame if the link takes it now; the microservices repeat what is lost."""
    try:
        if address is None:
            sock.send(frame, socket.MSG_DONTWAIT)
        else:
            sock.sendto(frame, address)
    except OSError:
        pass


def _waits(sock: socket.socket) -> bool:
    """Return whether a datagram waits in a socket."""
    try:
        sock.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except OSError:
        return False
    return True


def log(system: int, text: str) -> None:
    """Write a line about a UAV to standard error, which is its log."""
    with contextlib.suppress(OSError):  # a full disk must not end the flight
        log_line(f"ftc-autopilot {system}: {text}")

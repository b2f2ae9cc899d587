"""The plant process: ``sitl-plant CONFIG``.

It binds the simulator link's port, waits until an autopilot has registered and armed for every
aircraft, flies, and reports at the end why it stopped. Exit status: 0 flown to the end or stopped
by a signal, 1 the flight was lost or an autopilot fell silent, 2 bad input.
"""

import contextlib
import secrets
import socket
import sys
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_defs import dialect, endpoint
from mavlink_defs.config.files import load
from mavlink_defs.config.models import ConfigError, Problem
from mavlink_defs.constants import SIMULATOR_COMPONENT
from mavlink_defs.framing.codec import drop_counts
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, parse
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.framing.hot_signing import load_link_signer, refresh, sign_bytes
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import PLANT_LINK, SigningError, counts_text
from mavlink_defs.runtime.arguments import ArgumentParser
from mavlink_defs.runtime.shutdown import on_stop
from mavlink_defs.runtime.sockaddr import address_of
from mavlink_defs.runtime.spool import unwritten
from mavlink_defs.visible import log_line
from sitl_plant.config import PlantConfig
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import contacts_of, loss_of, new_plant_state
from sitl_plant.loop.link import new_link, run, send_states
from sitl_plant.loop.period import time_s
from sitl_plant.loop.recorder import RECORD_ROWS, Recorder
from sitl_plant.loop.registration import Claim, Registration
from sitl_plant.loop.service import AircraftService
from sitl_plant.loop.simulators import Outside
from sitl_plant.simulators.base import SimulatorError

_TICK_S = 0.02
_END_TIMEOUT_S = 1.0
"""Longest wait for the autopilots to acknowledge the end of the simulation."""
_DROPS_PERIOD_S = 1.0
_STEPS_MAX = 2**31  # 24 days at 1 kHz


class Plant:
    """Socket and wall clock around the compiled loop, the registration and the services."""

    def __init__(
        self,
        config: PlantConfig,
        sock: socket.socket,
        record: Path | None,
        key_file: KeyFile | None,
        *,
        record_optional: bool = False,
    ) -> None:
        self._config = config
        self._record_optional = record_optional
        self._sock = sock
        self._fd = sock.fileno()
        endpoint.set_receive_timeout(sock, _TICK_S)
        last_step = _STEPS_MAX
        if config.duration_s is not None:
            last_step = round(config.duration_s * 1e6 / config.step_us)
        systems = [uav.id for uav in config.uavs]
        self._fleet = new_plant_state(config)
        self._outside = Outside(config, self._fleet)
        self._fleet.uavs["message"]["run"] = 2**31 + secrets.randbits(31)  # all states of one size
        rows = 0 if record is None else RECORD_ROWS
        self._key_file = key_file
        signer = load_link_signer(key_file, PLANT_LINK)
        self._link = new_link(systems, config.step_us, last_step, config.speed, rows, signer)
        self._recorder = None if record is None else Recorder(self._link, record)
        self._state = self._link.state[0]
        self._registration = Registration(
            self._link, config.silence_timeout_s, config.wait_for_restart, _log
        )
        self._services = [
            AircraftService(
                uav.id,
                SIMULATOR_COMPONENT,
                faults_of(self._fleet, i, uav.aircraft.fault_limits),
            )
            for i, uav in enumerate(config.uavs)
        ]
        self._packers = [
            FramePacker(uav.id, SIMULATOR_COMPONENT, self._counter(i))
            for i, uav in enumerate(config.uavs)
        ]
        self._begin_s = 0.0
        self._drops_due_s = 0.0
        self.wall_s = 0.0
        self.stopping = False

    def fly(self) -> str | None:
        """Serve the link until the flight is over; return the reason if it ended early."""
        loss, outcome, turn_s = None, ReturnReason.NONE, 0.0
        while not self.stopping:
            outcome = run(self._fd, self._link, self._fleet, turn_s)
            if outcome == ReturnReason.ADVANCE:
                self._outside.advance()
                continue
            now = time.monotonic()
            self._registration.note_turn(now)
            if (loss := self._keep_record()) is not None:
                break
            if outcome == ReturnReason.SERVICE:
                self._serve()
            elif outcome == ReturnReason.OVER:
                break
            elif outcome == ReturnReason.LOST:
                i = int(self._state["lost"])
                why = self._outside.failures.get(i) or loss_of(self._fleet, i)
                loss = f"UAV {self._link.peers[i]['system']} was lost at {self.time_s:.3f} s: {why}"
                break
            if now >= turn_s:  # also when messages come without a pause
                turn_s = now + _TICK_S
                if (loss := self._check_silence_and_refresh(now)) is not None:
                    break
            if self._key_file is not None:
                refresh(self._key_file, self._link.signer)
            self._report_drops()
        if self._running:
            self.wall_s = time.monotonic() - self._begin_s
        self._end_simulation(lost=outcome == ReturnReason.LOST)
        return loss

    @property
    def time_s(self) -> float:
        """Simulation time [s]."""
        return time_s(int(self._state["step"]), self._config.step_us)

    def finish_record(self, loss: str | None) -> str | None:
        """Write the end of the record; return `loss`, or why it cannot be written."""
        try:
            if self._recorder is not None:
                contacts = contacts_of(self._fleet)
                self._recorder.finish(loss, int(self._state["step"]), self.wall_s, contacts)
        except Exception as problem:
            if not (self._record_optional or isinstance(problem, OSError)):
                raise
            return loss if self._record_optional else unwritten(problem)
        return loss

    def _keep_record(self) -> str | None:
        """Write the record if it is full; return why it cannot be written."""
        try:
            if self._recorder is not None:
                self._recorder.keep()
        except Exception as problem:
            if self._recorder is None or not (
                self._record_optional or isinstance(problem, OSError)
            ):
                raise
            if not self._record_optional:
                return unwritten(problem)
            self._recorder.give_up()
            _log(f"{unwritten(problem)}; flying on without recording")
        return None

    @property
    def _running(self) -> bool:
        return bool(self._state["flags"] & dialect.FTC_SIM_FLAGS_RUNNING)

    def _counter(self, i: int) -> Callable[[], int]:
        def next_sequence() -> int:
            self._link.peers["sequence"][i] += 1
            return int(self._link.peers["sequence"][i]) - 1

        return next_sequence

    def _serve(self) -> None:
        datagram = self._state["datagram"]["bytes"][: int(self._state["received"])].tobytes()
        message = parse(datagram)
        systems = self._link.peers["system"].tolist()
        if message is None:
            self._link.drops[-drop_reason(datagram)] += 1
            return
        if (
            message.get_srcComponent() != dialect.MAV_COMP_ID_AUTOPILOT1
            or message.get_srcSystem() not in systems
        ):
            self._link.drops[-DropReason.STRANGER] += 1
            return
        i = systems.index(message.get_srcSystem())
        now = time.monotonic()
        claim = self._registration.claim(i, now)
        if claim is Claim.REFUSED:
            self._link.drops[-DropReason.STRANGER] += 1
            return
        if claim is Claim.NEW and self._running:
            send_states(self._fd, self._link, self._fleet, True)
        service = self._services[i]
        service.receive(message, self.time_s, now)
        for answer in service.messages_to_send():
            self._send(i, answer)
        if (
            not self._running
            and self._link.peers["known"].all()
            and all(s.armed for s in self._services)
        ):
            self._start()

    def _send(self, i: int, message: dialect.MAVLink_message) -> None:
        host = address_of(self._link.peers["address"][i])
        frame = sign_bytes(self._link.signer, self._packers[i].pack(message))
        with contextlib.suppress(OSError):  # the microservices repeat what is lost
            self._sock.sendto(frame, (host.host, host.port))

    def _report_drops(self) -> None:
        """Send the autopilots FTC_DROPS once a second."""
        now = time.monotonic()
        if now < self._drops_due_s:
            return
        self._drops_due_s = now + _DROPS_PERIOD_S
        counts, none = drop_counts(self._link.drops), [0] * len(DropReason)
        time_ms = round(self.time_s * 1e3) & 0xFFFFFFFF
        message = dialect.MAVLink_ftc_drops_message(time_ms, none, none, none, counts)
        for i in np.flatnonzero(self._link.peers["known"]):
            self._send(int(i), message)

    def _start(self) -> None:
        self._state["flags"] |= dialect.FTC_SIM_FLAGS_RUNNING
        self._begin_s = self._state["origin_s"] = time.monotonic()
        self._state["origin_step"] = self._state["step"]
        _log(f"all armed, simulated time starts at Unix time {time.time():.3f}")

    def _check_silence_and_refresh(self, now: float) -> str | None:
        """Check for silent autopilots, and send the state again while time is paused.

        Args:
            now: Wall-clock time [s].

        Returns:
            Why the flight must end; None if it continues.
        """
        loss = self._registration.check_silence(now)
        if not self._running:
            send_states(self._fd, self._link, self._fleet, False)
        return loss

    def refused(self) -> Counter[str]:
        """Return the datagrams dropped, by reason."""
        drops = self._link.drops
        return +Counter({reason.text: int(drops[-reason]) for reason in DropReason})

    def _end_simulation(self, lost: bool) -> None:
        """Send every autopilot the end of the simulation until each has acknowledged it."""
        self._state["flags"] |= dialect.FTC_SIM_FLAGS_ENDED | (
            dialect.FTC_SIM_FLAGS_LOST if lost else 0
        )
        self._state["flags"] &= ~dialect.FTC_SIM_FLAGS_RUNNING
        end = time.monotonic() + _END_TIMEOUT_S
        send_states(self._fd, self._link, self._fleet, False)
        while time.monotonic() < end and self._unfinished():
            run(self._fd, self._link, self._fleet, time.monotonic() + _TICK_S)
            send_states(self._fd, self._link, self._fleet, True)

    def _unfinished(self) -> bool:
        link = self._link
        return bool(((link.peers["done"] < self._state["step"]) & (link.peers["known"] == 1)).any())


class PreparedPlant(NamedTuple):
    """What a process has before it opens its socket; one that is forked may begin with it."""

    options: Namespace
    config: PlantConfig
    key_file: KeyFile | None


def prepare(arguments: list[str] | None = None) -> PreparedPlant:
    """Read the configuration.

    Raises:
        ConfigError, SigningError: It cannot be used.
    """
    parser = ArgumentParser(
        prog="sitl-plant",
        description="Simulate the aircraft of one fleet; autopilots connect over MAVLink.",
        epilog="`gcs fly` writes such a CONFIG for a scenario into its run folder.",
    )
    parser.add_argument("config", type=Path, metavar="CONFIG", help="plant configuration (YAML)")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="write all steps as .npy")
    parser.add_argument(
        "--record-optional",
        action="store_true",
        help="fly on if FOLDER cannot be written; the reader removes what it has read",
    )
    parser.add_argument(
        "--exit-with-parent", type=int, metavar="PID", help="stop when this parent process is gone"
    )
    options = parser.parse_args(arguments)
    config = load(options.config, PlantConfig)
    if options.record and config.duration_s is None and not options.record_optional:
        raise ConfigError(
            options.config, [Problem(("duration_s",), "missing; --record needs an end")]
        )
    key_file = KeyFile(config.signing_key, _log) if config.signing_key else None
    return PreparedPlant(options, config, key_file)


def main(arguments: list[str] | None = None, prepared: PreparedPlant | None = None) -> None:
    """Run the plant process and exit; `prepared` of the same arguments, if it is there."""
    try:
        options, config, key_file = prepared or prepare(arguments)
        address = endpoint.parse_address(config.bind)
        sock = endpoint.bind_udp(address, "plant", "change `bind`")
    except (ConfigError, endpoint.EndpointError, SigningError) as problem:
        log_line(problem)
        sys.exit(2)
    if not endpoint.is_loopback(address):
        _log(endpoint.exposed(address, config.signing_key is not None))
    try:
        plant = Plant(
            config, sock, options.record, key_file, record_optional=options.record_optional
        )
    except SimulatorError as problem:
        log_line(f"{problem}; {problem.hint}" if problem.hint else problem)
        sys.exit(2)
    except SigningError as problem:
        log_line(problem)
        sys.exit(2)
    except OSError as problem:
        log_line(unwritten(problem))
        sys.exit(2)

    def stop() -> None:
        plant.stopping = True

    on_stop(stop, options.exit_with_parent)
    with sock:
        loss = plant.fly()
    loss = plant.finish_record(loss)
    if refused := plant.refused():
        _log(f"frames dropped: {counts_text(refused)}")
    if loss is not None:
        _log(loss)
    sys.exit(0 if loss is None else 1)


def _log(text: str) -> None:
    with contextlib.suppress(OSError):  # a full disk must not end the flight
        log_line(f"sitl-plant: {text}")

"""Fuzzing targets: each takes datagrams, and exposes its state for comparison.

Autopilot and plant are the ones that the processes run, with compiled loops and loopback sockets;
they are driven from here instead of by `fly`. Nothing waits: each datagram is sent before its
receiver polls for it.
"""

import socket
import tempfile
import time
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ftc_autopilot.autopilot import Autopilot
from ftc_autopilot.control.stepping import controller_step
from ftc_autopilot.hot.formation_link import receive_neighbour_states
from ftc_autopilot.hot.loop import new_loops, run
from ftc_autopilot.hot.state import FORMATION_SIGNER, new_autopilots
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.station.status import drop_lines, fleet_table, vehicle_status
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogError, read_tlog
from mavlink_defs.endpoint import Connection, parse_address
from mavlink_defs.endpoint import UdpAddress as Endpoint
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, parse
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.runtime.sockaddr import sockaddr
from sitl_plant.loop import link as plant_link
from sitl_plant.loop.fleet import fly
from sitl_plant.loop.process import Plant

UAV = 2
"""The autopilot's system id: it has one neighbour, `NEIGHBOUR`."""
NEIGHBOUR = 1
_LOOPBACK = ("127.0.0.1", 0)
_LOCKSTEP = dialect.FTC_SIM_FLAGS_RUNNING | dialect.FTC_SIM_FLAGS_LOCKSTEP


class Target(Protocol):
    """Something that takes datagrams.

    Attributes:
        sender: System and component id of the sender to imitate.
        target: System and component id of the receiver.
    """

    sender: tuple[int, int]
    target: tuple[int, int]

    def feed(self, datagram: bytes) -> None:
        """Take in a datagram and do all that it causes."""

    def state(self) -> bytes:
        """Return all that an invalid datagram must leave as it is."""

    def drops(self) -> int:
        """Return the number of datagrams counted as dropped."""

    def close(self) -> None:
        """Close the sockets."""


def _udp() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(_LOOPBACK)
    sock.setblocking(False)
    return sock


class AutopilotTarget:
    """An autopilot in flight, fuzzed on one of its three sockets."""

    target = (UAV, dialect.MAV_COMP_ID_AUTOPILOT1)

    def __init__(self, scenario: Scenario, port: str) -> None:
        """Start one.

        Args:
            scenario: Whose UAV 2 it is.
            port: "gcs", "simulator" or "formation": the socket that receives the datagrams.
        """
        self._plant, self._own, self._formation, self._gcs = (_udp() for _ in range(4))
        self._own.connect(self._plant.getsockname())
        config = scenario.autopilot_config(UAV)
        station = "{}:{}".format(*self._plant.getsockname())
        neighbours = tuple(n.model_copy(update={"address": station}) for n in config.neighbours)
        update = {"gcs": (station,), "plant": station, "neighbours": neighbours}
        config = config.model_copy(update=update)
        self._state = new_autopilots([config])
        sockets = self._own, self._formation, self._gcs
        self._autopilot = Autopilot(config, self._state, *sockets, None, None)
        self._formation.setblocking(False)
        self._own.setblocking(False)
        self._fuzzed = {
            "gcs": self._gcs,
            "simulator": self._own,
            "formation": self._formation,
        }[port]
        senders = {"gcs": (255, 190), "simulator": (UAV, 25), "formation": (NEIGHBOUR, 1)}
        self.sender = senders[port]
        self._is_formation = port == "formation"
        self._controllers, self._row = self._state.controllers, self._state.own[0]
        self._steps = 0
        self._arm()
        self._row["measured"]["velocity"] = (40.0, 0.0, 0.5)
        self._row["link"]["flags"], self._row["link"]["heard_s"] = 0, time.monotonic()
        self.step()

    def feed(self, datagram: bytes) -> None:
        """Take in a datagram and do all that it causes."""
        self._plant.sendto(datagram, self._fuzzed.getsockname())
        self._row["link"]["flags"] &= _LOCKSTEP
        self._row["link"]["heard_s"] = time.monotonic()
        if self._is_formation:
            signer = self._state.signer(0, FORMATION_SIGNER)
            edges = self._state.edges[0]
            receive_neighbour_states(self._formation.fileno(), self._row, edges, signer, 0)
            return
        loops = new_loops(self._state, [self._autopilot.sockets])
        loops.state["until_step"] = 2**62
        run(loops)
        outcome = loops.state[0]["outcome"]
        if outcome == ReturnReason.SERVICE:
            self._autopilot._receive_from_simulator()
        elif outcome == ReturnReason.RESTARTED:
            self._autopilot._vehicle.restart()
            self._arm()
        self._autopilot._receive_from_ground_stations(1)
        self._autopilot._send_messages()

    def _arm(self) -> None:
        self._controllers.uavs[0]["guidance"]["active"] = 1
        self._autopilot._vehicle.modes.armed = True

    def handle_timer(self, now: float) -> None:
        """Run the timers; all messages are sent, so they must be possible to pack."""
        self._autopilot._vehicle.handle_timer(now)
        self._autopilot._send_messages()
        _drain(self._plant)

    def step(self) -> np.ndarray:
        """Make a control step of a healthy aircraft; the commands that come of it."""
        state = np.zeros(1, codec.SIM_STATE)
        state["velocity"] = (40.0, 0.0, 0.5)
        state["step"], self._steps = self._steps, self._steps + 1
        controller_step(*self._controllers.of(0), state[0], 1000)
        controls: np.ndarray = self._controllers.uavs[0]["actuators"]["controls"]
        return controls

    def state(self) -> bytes:
        """Return all that an invalid datagram must leave as it is."""
        vehicle, state = self._autopilot._vehicle, self._row["link"]
        names = ("step", "pending_usec", "repeated")
        values = repr(
            (
                vehicle.modes.mode,
                vehicle.modes.armed,
                vehicle.telemetry[0]._intervals_us,
                vehicle._plan.mission.server.items,
                [p.get() for p in vehicle._params._parameters],
            )
        )
        memory: bytes = (
            b"".join(array.tobytes() for array in self._controllers)
            + b"".join(state[name].tobytes() for name in names)
            + self._row["formation"]["edge_changes"].tobytes()
            + self._row["measured"].tobytes()
            + values.encode()
        )
        return memory

    def drops(self) -> int:
        """Return the number of datagrams counted as dropped."""
        return int(self._row["drops"][:3].sum())

    def close(self) -> None:
        """Close the sockets."""
        for sock in (self._plant, self._own, self._formation, self._gcs):
            sock.close()


class PlantTarget:
    """A plant whose simulated time runs, fuzzed by its autopilot or by a stranger."""

    target = (1, 25)

    def __init__(self, scenario: Scenario, stranger: bool) -> None:
        self._peer, self._other, self._sock = _udp(), _udp(), _udp()
        self._plant = Plant(scenario.plant_config(), self._sock, record=None, key_file=None)
        self._sock.setblocking(False)
        self._fuzzed = self._other if stranger else self._peer
        self.sender = (1, dialect.MAV_COMP_ID_AUTOPILOT1)
        self._link, self._fleet = self._plant._link, self._plant._fleet
        self._link.peers["address"][:] = sockaddr(Endpoint(*self._peer.getsockname()))
        self._link.peers["known"][:] = 1
        self._link.state["flags"] = _LOCKSTEP

    def feed(self, datagram: bytes) -> None:
        """Take in a datagram and do all that it causes."""
        self._link.peers["heard_s"][:] = self._link.state["sent_s"] = time.monotonic()
        self._fuzzed.sendto(datagram, self._sock.getsockname())
        outcome = plant_link.run(self._sock.fileno(), self._link, self._fleet, 0.0)
        if outcome == ReturnReason.SERVICE:
            self._plant._serve()
        assert outcome in {ReturnReason.SERVICE, ReturnReason.TICK}, outcome
        _drain(self._peer)

    def fly(self, steps: int) -> np.ndarray:
        """Let time pass; the states that come of it."""
        for step in range(steps):
            fly(self._fleet, step, 1000)
        return self._fleet.uavs["state"]

    def state(self) -> bytes:
        """Return all that an invalid datagram must leave as it is."""
        services = [service.armed for service in self._plant._services]
        arrays = (
            self._fleet.uavs["state"],
            self._fleet.uavs["controls"],
            self._fleet.uavs["faults"],
            self._link.peers["done"],
            self._fleet.uavs["message"]["actuator_time_usec"],
            self._link.peers["known"],
            self._link.peers["address"],
        )
        return b"".join(array.tobytes() for array in arrays) + repr(services).encode()

    def drops(self) -> int:
        """Return the number of datagrams counted as dropped."""
        return int(self._link.drops.sum())

    def close(self) -> None:
        """Close the sockets."""
        for sock in (self._peer, self._other, self._sock):
            sock.close()


class StationTarget:
    """A ground station's client with one vehicle and no socket."""

    sender = (UAV, dialect.MAV_COMP_ID_AUTOPILOT1)
    target = (255, 190)

    def __init__(self) -> None:
        connection = Connection("in", parse_address("127.0.0.1:14550"))
        self.client = Client(connection, clock=lambda: self._now)
        heartbeat = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 4, 3)
        self._now = 0.0
        self.feed(FramePacker(*self.sender).pack(heartbeat))

    def feed(self, datagram: bytes) -> None:
        """Take in a datagram and do all that it causes."""
        self.client.datagram_received(datagram, ("127.0.0.1", 14601))

    def handle_timer(self, now: float) -> None:
        """Let time pass, and show everything as `gcs status` does."""
        self._now = now
        self.client.fleet.handle_timer(now)
        states = list(self.client.fleet.vehicles.values())
        fleet_table(states, now)
        drop_lines(self.client.drops, states)
        for state in states:
            vehicle_status(state, now)
            state.counts.rates()

    def state(self) -> bytes:
        """Return all that an invalid datagram must leave as it is."""
        fleet = self.client.fleet
        known = {
            i: (s.heard_at, len(s.texts), s.restarts, {k: id(m) for k, m in s.latest.items()})
            for i, s in fleet.vehicles.items()
        }
        return repr((known, fleet.unconfirmed, self.client._peers, len(self.client.log))).encode()

    def drops(self) -> int:
        """Return the number of datagrams counted as dropped."""
        return self.client.drops.total()

    def close(self) -> None:
        """Do nothing: there is no socket."""


def parse_all_ways(datagram: bytes) -> bool:
    """Put a datagram through the parsers; whether it is a good frame, on which all agree."""
    message = parse(datagram)
    buffer = codec.new_buffer()
    length = min(len(datagram), codec.BUFFER_SIZE)
    buffer[:length] = np.frombuffer(datagram[:length], np.uint8)
    code = codec.check(buffer, length)
    if message is None:
        assert drop_reason(datagram) in set(DropReason)
        assert code < 0 or len(datagram) > codec.BUFFER_SIZE, code
    else:
        assert code in {codec.FOREIGN, codec.SIGNED, message.get_msgId()}, code
    return message is not None


def records_of_tlog(data: bytes) -> int:
    """Read bytes as a telemetry log; the number of records before what is no record."""
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fuzz.tlog"
        path.write_bytes(data)
        try:
            for _ in read_tlog(path):
                count += 1
        except TlogError:
            pass
    return count


def _drain(sock: socket.socket) -> list[Any]:
    received = []
    try:
        while True:
            received.append(sock.recv(codec.BUFFER_SIZE))
    except BlockingIOError:
        return received

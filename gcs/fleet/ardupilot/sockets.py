"""Sockets and clock around a flight by ArduPilot: one UDP port for each UAV."""

import contextlib
import selectors
import socket
import time
from collections.abc import Callable, Iterator, Sequence

from gcs.console.errors import NoAnswer, bad_endpoint
from gcs.console.stopping import noting_ctrl_c
from gcs.fleet.ardupilot.faults import FaultStation
from gcs.fleet.ardupilot.flight import ArduPilotFlight
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, bind_udp
from sitl_plant.ardupilot.protocol import PORT, PORTS_APART

_TURN_S = 0.2
_QUIET_S = 5.0
"""Silence of an ArduPilot in flight that is worth a word [s]."""
_PROGRESS_S = 0.2
_MAX_DATAGRAM = 2048  # bytes read of a datagram; a servo packet has 72 at most


@contextlib.contextmanager
def bound(
    addresses: Sequence[UdpAddress], hint: str = "choose another with --port"
) -> Iterator[list[socket.socket]]:
    """Bind a socket to each address; `hint` says what to do if a port is in use.

    Raises:
        BadInput: A port is in use (PortInUse), or the host is not this machine.
    """
    with contextlib.ExitStack() as sockets:
        found = []
        for address in addresses:
            try:
                sock = bind_udp(address, "gcs ardupilot", hint)
            except EndpointError as problem:
                raise bad_endpoint(problem) from None
            sock.setblocking(False)
            found.append(sockets.enter_context(sock))
        yield found


def how_to_start(scenario: Scenario, addresses: Sequence[UdpAddress]) -> list[str]:
    """Return the command that starts ArduPlane for each UAV, a line for each."""
    lines = []
    for k, (uav, address) in enumerate(zip(scenario.uavs, addresses, strict=True)):
        usual = address.port == PORT + PORTS_APART * k
        port = "" if usual else f" --sim-port-out {address.port}"
        lines.append(f"UAV {uav.id}: arduplane --model JSON:{address.host}{port} -I {k}")
    return lines


class Served:
    """A flight and how long it took.

    Attributes:
        wall_s: Wall-clock time since its first step [s].
        silence: Why it ended before its end; None if no ArduPilot fell silent.
    """

    def __init__(self, flight: ArduPilotFlight) -> None:
        self.flight = flight
        self.wall_s = 0.0
        self.silence: str | None = None


def serve(
    scenario: Scenario,
    served: Served,
    sockets: Sequence[socket.socket],
    patience_s: float,
    notify: Callable[[str], None],
    on_progress: Callable[[float], None],
    stations: socket.socket | None = None,
) -> None:
    """Serve the ArduPilots until the flight is over.

    Args:
        scenario: The scenario.
        served: The flight; what is known of it is written to it, also if Ctrl-C ends it.
        sockets: Of each UAV, not blocking.
        patience_s: Silence that ends it [s, wall time].
        notify: Called with a line for the operator.
        on_progress: Called with the simulated time [s] now and then.
        stations: Where ground stations set faults, not blocking; None: nowhere.

    Raises:
        NoAnswer: No ArduPilot came for a UAV.
        KeyboardInterrupt: It was stopped, between two frames.
    """
    flight = served.flight
    ids = [uav.id for uav in scenario.uavs]
    begin = time.monotonic()
    heard_s = [begin] * len(ids)
    quiet: set[int] = set()
    first_step_s: float | None = None
    shown_s = begin
    with selectors.DefaultSelector() as selector, noting_ctrl_c() as stopped:
        for i, sock in enumerate(sockets):
            selector.register(sock, selectors.EVENT_READ, i)
        faults = FaultStation(scenario, flight)
        if stations is not None:
            selector.register(stations, selectors.EVENT_READ, None)
        while not (flight.is_over or stopped):
            ready = selector.select(_TURN_S)
            now = time.monotonic()
            if stations is not None:
                _serve_stations(faults, stations, now)
            for key, _ in ready:
                if key.data is None:
                    continue
                i, sock = key.data, sockets[key.data]
                for datagram, address in _received(sock):
                    frames = flight.peers[i].frames
                    for k, data, to in flight.receive(i, datagram, address, now):
                        with contextlib.suppress(OSError):  # the next frame asks again
                            sockets[k].sendto(data, to)
                    heard_s[i] = flight.peers[i].heard_s or heard_s[i]
                    if flight.peers[i].frames > frames:
                        quiet.discard(i)
            if flight.is_flying:
                first_step_s = now if first_step_s is None else first_step_s
                served.wall_s = now - first_step_s
            else:
                first_step_s = None
            if now - shown_s > _PROGRESS_S:
                shown_s = now
                on_progress(flight.step * scenario.step_us / 1e6)
            for i in flight.waiting_for():
                silent_s = now - max(heard_s[i], begin)
                who = f"the ArduPilot of UAV {ids[i]}"
                at = f"at {flight.step * scenario.step_us / 1e6:.3f} s"
                if silent_s > patience_s and flight.peers[i].frames:
                    served.silence = f"{who} has been silent for {patience_s:g} s {at}"
                    break
                if silent_s > patience_s:
                    raise NoAnswer(
                        f"no ArduPilot has come for UAV {ids[i]} for {patience_s:g} s"
                        f"{_strangers(flight, i)}",
                        "start it as said above, or leave the UAV out, as with --uav 1",
                    )
                if flight.peers[i].frames and silent_s > _QUIET_S and i not in quiet:
                    quiet.add(i)
                    notify(f"{who} has been silent for {_QUIET_S:g} s {at}; the plant waits for it")
            if served.silence is not None:
                break
    if stopped:
        raise KeyboardInterrupt


def _serve_stations(faults: FaultStation, sock: socket.socket, now: float) -> None:
    for datagram, address in _received(sock):
        for frame in faults.receive(datagram, address, now):
            with contextlib.suppress(OSError):  # they repeat what is lost
                sock.sendto(frame, address)
    for frame, address in faults.due(now):
        with contextlib.suppress(OSError):
            sock.sendto(frame, address)


def _strangers(flight: ArduPilotFlight, i: int) -> str:
    """Say what has come in place of servo packets."""
    dropped = flight.peers[i].dropped
    reasons = "; ".join(f"{count} with {reason}" for reason, count in dropped.items())
    total = sum(dropped.values())
    return f": of {total} datagrams none was a servo packet ({reasons})" if total else ""


def _received(sock: socket.socket) -> Iterator[tuple[bytes, tuple[str, int]]]:
    """Yield the datagrams that have come."""
    while True:
        try:
            datagram, address = sock.recvfrom(_MAX_DATAGRAM)
        except BlockingIOError:
            return
        except OSError:  # an earlier answer found nobody
            continue
        yield datagram, address

"""UDP endpoints of the processes: addresses as text, and as sockets.

IPv4 only. All sockets are blocking (see `set_receive_timeout`), and none shares its port: a
second program that wants the same port gets an `EndpointError`, not half of the datagrams.
"""

import errno
import ipaddress
import random
import re
import socket
import struct
import sys
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Literal, TypeAlias

Direction: TypeAlias = Literal["in", "out"]

_EVERY_INTERFACE, _LOOPBACK = "0.0.0.0", "127.0.0.1"
_RANDOM = random.SystemRandom()  # processes that look at the same time find different ports
BSD_LIKE = sys.platform.startswith(("darwin", "freebsd", "netbsd", "openbsd"))
_RECEIVE_BUFFER = 1 << 20  # bytes; the system may grant less
_ENDPOINT = re.compile(r"(?:udp(?:in|out)?:(?://)?)?(?P<host>[^\s:/\[\]]+):(?P<port>[0-9]{1,5})")


class EndpointError(Exception):
    """An address cannot be used; the message names it, its purpose and a remedy."""


class PortTaken(EndpointError):  # noqa: N818 - the name says it
    """Another socket has the port."""


@dataclass(frozen=True)
class UdpAddress:
    """A UDP address: host name or IPv4 address, and port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def parse_address(text: str) -> UdpAddress:
    """Read "host:port", also with "udp:", "udpin:" or "udpout:" before it, as MAVProxy has it.

    Raises:
        EndpointError: The text is something else.
    """
    match = _ENDPOINT.fullmatch(text.strip())
    if match is None or not 1 <= int(match["port"]) <= 65535:
        raise EndpointError(f"expected host:port with an IPv4 host and port 1-65535, got '{text}'")
    return UdpAddress(match["host"], int(match["port"]))


@dataclass(frozen=True)
class Connection:
    """A ground station's link: the address that it binds ("in") or sends to ("out")."""

    direction: Direction
    address: UdpAddress

    def __str__(self) -> str:
        return f"udp{self.direction}:{self.address}"


def parse_connection(text: str) -> Connection:
    """Read "udpin:host:port" or "udpout:host:port"; "udp:" or nothing before it means "udpin:".

    MAVSDK's spelling with "//" before the host is understood as well.

    Raises:
        EndpointError: The text is something else.
    """
    try:
        address = parse_address(text)
    except EndpointError:
        form = "udpin:host:port or udpout:host:port with an IPv4 host and port 1-65535"
        raise EndpointError(f"expected {form}, got '{text}'") from None
    return Connection("out" if text.strip().startswith("udpout:") else "in", address)


def resolve(address: UdpAddress) -> UdpAddress:
    """Return the IPv4 address to which an address resolves; answers come from it.

    0.0.0.0 stands for this machine.

    Raises:
        EndpointError: The host's name cannot be resolved.
    """
    ip = _resolve(address)
    return UdpAddress(_LOOPBACK if ip == _EVERY_INTERFACE else ip, address.port)


def is_loopback(address: UdpAddress) -> bool:
    """Return whether only this machine can reach the address.

    Raises:
        EndpointError: The host's name cannot be resolved.
    """
    return ipaddress.ip_address(_resolve(address)).is_loopback


def exposed(address: UdpAddress | str, signed: bool) -> str:
    """Return a warning about an address that is not loopback.

    Args:
        address: The address, or its host.
        signed: Whether unsigned frames are refused there.
    """
    text = f"warning: {address} can be reached from other machines"
    return (
        f"{text}; signed frames only"
        if signed
        else f"{text}; sign (links.signing_key, --signing-key)"
    )


def bind_udp(address: UdpAddress, what: str, hint: str = "") -> socket.socket:
    """Open a UDP socket that receives at an address.

    Args:
        address: Where to receive; port 0 lets the system choose.
        what: Whose socket it is, for the error message: "ground station".
        hint: What the user can do when the port is taken, such as "choose another port with
            --gcs-port".

    Raises:
        PortTaken: The port is in use.
        EndpointError: The address is not one of this machine's.
    """
    ip = _resolve(address)
    sock = _udp_socket()
    try:
        sock.bind((ip, address.port))
    except OSError as exc:
        sock.close()
        kind = PortTaken if exc.errno == errno.EADDRINUSE else EndpointError
        raise kind(_why_not_bound(exc, address, what, hint)) from exc
    return sock


def connect_udp(address: UdpAddress) -> socket.socket:
    """Open a UDP socket, on a port of the system's choice, connected to one peer.

    Raises:
        EndpointError: The host's name cannot be resolved, or no route leads there.
    """
    ip = _resolve(address)
    sock = _udp_socket()
    try:
        sock.connect((ip, address.port))
    except OSError as exc:
        sock.close()
        raise EndpointError(f"cannot reach {address} over UDP: {exc.strerror}") from exc
    return sock


def connected_twin(sock: socket.socket, peer: tuple[str, int]) -> socket.socket:
    """Open another socket at the address of a bound one, which receives what one peer sends there.

    For a moment before it is connected it may receive what others send. The bound one shares its
    port no longer than that, so another program still cannot bind it. Twins share it for good, or
    there could be no second one.

    Raises:
        OSError: The system gives no such socket.
    """
    share = socket.SO_REUSEPORT if BSD_LIKE else socket.SO_REUSEADDR
    twin = _udp_socket()
    try:
        for one in (sock, twin):
            one.setsockopt(socket.SOL_SOCKET, share, 1)
        twin.bind(sock.getsockname())
        twin.connect(peer)
    except BaseException:
        twin.close()
        raise
    finally:
        with suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, share, 0)
    return twin


def open_udp(peers: Iterable[UdpAddress]) -> socket.socket:
    """Open a UDP socket, on a port of the system's choice, for talking to some peers.

    It can be reached only at the address that this machine has on the way to them; at all of
    them if the ways differ.

    Raises:
        EndpointError: A host's name cannot be resolved, or no route leads there.
    """
    own = set()
    for peer in peers:
        with connect_udp(peer) as probe:
            own.add(str(probe.getsockname()[0]))
    sock = _udp_socket()
    sock.bind((own.pop() if len(own) == 1 else _EVERY_INTERFACE, 0))
    return sock


def someone_listens(address: UdpAddress) -> bool:
    """Return whether a UDP port of this machine is bound by someone.

    An empty datagram finds out; for another machine the answer is True.
    """
    try:
        with connect_udp(address) as sock:
            sock.setblocking(False)
            sock.send(b"")
            sock.recv(1)
    except ConnectionRefusedError:
        return False
    except (BlockingIOError, EndpointError):
        pass
    return True


def set_receive_timeout(sock: socket.socket, seconds: float) -> None:
    """Limit the wait of `native.receive` on this socket to `seconds`, > 0.

    The kernel rounds up to its tick, up to 10 ms. Python's own ``recv`` then raises
    BlockingIOError on a timeout.
    """
    sock.settimeout(None)  # with a timeout of Python's, the descriptor would not block
    microseconds = max(1, round(seconds * 1e6))  # 0 would mean: for ever
    timeval = struct.pack("@ll", *divmod(microseconds, 1_000_000))
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval)


def free_ports(n: int, host: str = "127.0.0.1") -> list[int]:
    """Find n UDP ports in a row that are free at this moment.

    They lie below those that systems give to sockets that do not ask for a port, so that no such
    socket takes one of them before it is bound, and above those where vehicles are expected.

    Raises:
        EndpointError: The host is not this machine.
    """
    while True:
        first = _RANDOM.randrange(20_000, 32_768 - n)
        ports = list(range(first, first + n))
        with ExitStack() as sockets, suppress(PortTaken):
            for port in ports:
                sockets.enter_context(bind_udp(UdpAddress(host, port), "free port"))
            return ports


def _udp_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
    return sock


def _resolve(address: UdpAddress) -> str:
    try:
        return socket.gethostbyname(address.host)
    except (socket.gaierror, UnicodeError) as exc:  # an empty part of a name cannot be encoded
        why = getattr(exc, "strerror", None) or exc
        raise EndpointError(f"unknown host '{address.host}': {why}") from exc


def _why_not_bound(exc: OSError, address: UdpAddress, what: str, hint: str) -> str:
    if exc.errno == errno.EADDRINUSE:
        advice = "stop the other program" + (f", or {hint}" if hint else "")
        return f"UDP port {address.port} on {address.host} is in use ({what}); {advice}"
    if exc.errno == errno.EADDRNOTAVAIL:
        return f"{address.host} is not an address of this machine ({what}); use 127.0.0.1"
    return f"cannot receive at {address} ({what}): {exc.strerror}" + (f"; {hint}" if hint else "")

"""Addresses and sockets."""

import contextlib
import socket
import time

import pytest

from mavlink_defs.endpoint import (
    EndpointError,
    UdpAddress,
    bind_udp,
    connect_udp,
    connected_twin,
    free_ports,
    is_loopback,
    open_udp,
    parse_address,
    resolve,
    set_receive_timeout,
)
from mavlink_defs.runtime.sockaddr import address_of, sockaddr

ANY_PORT = UdpAddress("127.0.0.1", 0)


@pytest.mark.parametrize("prefix", ["", "udp:", "udpin:", "udpout:", "udpin://"])
def test_addresses_are_read_as_other_tools_write_them(prefix: str) -> None:
    assert parse_address(f"{prefix}127.0.0.1:14550") == UdpAddress("127.0.0.1", 14550)
    assert str(parse_address(f" {prefix}uav-1.local:1 ")) == "uav-1.local:1"


NOT_ADDRESSES = [
    "",
    "14550",
    "host:",
    ":14550",
    "host:0",
    "host:65536",
    "host:-1",
    "host:٣",
    "host:1:2",
    "ho st:1",
    "tcp:host:1",
    "[::1]:1",
]


@pytest.mark.parametrize("text", NOT_ADDRESSES)
def test_other_text_is_refused_and_shown(text: str) -> None:
    with pytest.raises(EndpointError, match="expected host:port") as caught:
        parse_address(text)
    assert f"'{text}'" in str(caught.value)


def test_sockaddr_and_back() -> None:
    raw = sockaddr(UdpAddress("127.0.0.1", 14550))
    assert raw.shape == (16,)
    assert raw[2:8].tolist() == [14550 >> 8, 14550 & 0xFF, 127, 0, 0, 1]
    assert address_of(raw) == UdpAddress("127.0.0.1", 14550)


def test_names_and_every_interface_are_resolved_to_where_datagrams_go() -> None:
    assert resolve(UdpAddress("localhost", 1)) == UdpAddress("127.0.0.1", 1)
    assert resolve(UdpAddress("0.0.0.0", 1)) == UdpAddress("127.0.0.1", 1)
    assert address_of(sockaddr(UdpAddress("0.0.0.0", 1))) == UdpAddress("127.0.0.1", 1)
    assert resolve(UdpAddress("192.0.2.1", 1)) == UdpAddress("192.0.2.1", 1)


def test_loopback() -> None:
    assert is_loopback(UdpAddress("127.0.0.2", 1))
    assert is_loopback(UdpAddress("localhost", 1))
    assert not is_loopback(UdpAddress("0.0.0.0", 1))
    assert not is_loopback(UdpAddress("192.0.2.1", 1))


def test_unknown_host_is_named() -> None:
    with pytest.raises(EndpointError, match=r"unknown host 'nobody\.invalid'"):
        connect_udp(UdpAddress("nobody.invalid", 1))


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_a_taken_port_is_refused_with_advice(host: str) -> None:
    with bind_udp(ANY_PORT, "plant") as first:
        port = first.getsockname()[1]
        with pytest.raises(EndpointError) as caught:
            bind_udp(UdpAddress(host, port), "ground station", "choose another port with --port")
    assert str(caught.value) == (
        f"UDP port {port} on {host} is in use (ground station); "
        "stop the other program, or choose another port with --port"
    )


def test_a_foreign_address_is_refused() -> None:
    with pytest.raises(EndpointError, match=r"192\.0\.2\.1 is not an address of this machine"):
        bind_udp(UdpAddress("192.0.2.1", 0), "plant")


def test_free_ports_are_distinct_and_can_be_bound() -> None:
    ports = free_ports(20)
    assert len(set(ports)) == 20
    bind_udp(UdpAddress("127.0.0.1", ports[-1]), "test").close()


def test_connected_sockets_hear_their_peer_only() -> None:
    with (
        bind_udp(ANY_PORT, "peer") as peer,
        bind_udp(ANY_PORT, "other") as other,
        connect_udp(UdpAddress(*peer.getsockname())) as sock,
    ):
        set_receive_timeout(sock, 60.0)
        other.sendto(b"other", sock.getsockname())
        peer.sendto(b"peer", sock.getsockname())
        assert sock.recv(10) == b"peer"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0"])
def test_a_socket_for_peers_of_this_machine_is_reached_from_this_machine_only(host: str) -> None:
    with bind_udp(UdpAddress("0.0.0.0", 0), "peer") as peer:
        address = UdpAddress(host, peer.getsockname()[1])
        destination = (resolve(address).host, address.port)
        with open_udp([address, UdpAddress("127.0.0.1", 9)]) as sock:
            peer.settimeout(60.0)
            sock.settimeout(60.0)
            assert sock.getsockname()[0] == "127.0.0.1"
            sock.sendto(b"?", destination)
            datagram, sender = peer.recvfrom(10)
            assert (datagram, sender) == (b"?", sock.getsockname())
            peer.sendto(b"!", sender)
            assert sock.recvfrom(10) == (b"!", destination)


def test_a_socket_for_peers_that_cannot_be_found_is_refused() -> None:
    with pytest.raises(EndpointError, match=r"unknown host 'no\.\.such'"):
        open_udp([UdpAddress("no..such", 14550)])


def test_receive_timeout_undoes_pythons_own() -> None:
    with bind_udp(ANY_PORT, "test") as sock:
        sock.settimeout(120.0)
        set_receive_timeout(sock, 0.01)
        assert sock.getblocking()
        start = time.monotonic()
        with pytest.raises(BlockingIOError):
            sock.recv(1)
        assert time.monotonic() - start < 60.0
        set_receive_timeout(sock, 1e-9)  # not 0, which would wait for ever
        with pytest.raises(BlockingIOError):
            sock.recv(1)


def test_receive_buffer_is_enlarged() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain, bind_udp(ANY_PORT, "x") as ours:
        size = [s.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) for s in (plain, ours)]
    assert size[0] <= size[1]


def test_twins_receive_what_their_peers_send_and_no_other_program_can_bind_the_port() -> None:
    with contextlib.ExitStack() as sockets:
        sock, other, *peers = (
            sockets.enter_context(bind_udp(ANY_PORT, name)) for name in ("hub", "other", *"abc")
        )
        twins = [sockets.enter_context(connected_twin(sock, peer.getsockname())) for peer in peers]
        for one in (sock, *twins):
            one.settimeout(5.0)
        for _ in range(2):
            for sender in (other, *peers):
                sender.sendto(str(sender.getsockname()).encode(), sock.getsockname())
            for receiver, sender in zip((sock, *twins), (other, *peers), strict=True):
                assert receiver.recv(99) == str(sender.getsockname()).encode()
        for reuse in (False, True):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief:
                thief.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, reuse)
                with pytest.raises(OSError, match="in use"):
                    thief.bind(sock.getsockname())

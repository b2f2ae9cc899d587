"""libc's sockets and clock from compiled code, over loopback."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp, free_ports, set_receive_timeout
from mavlink_defs.runtime import native
from mavlink_defs.runtime.sockaddr import address_of, sockaddr

PROBE = """
import numpy as np
from mavlink_defs.runtime import native
from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp, set_receive_timeout
with bind_udp(UdpAddress("127.0.0.1", 0), "probe") as server:
    port = server.getsockname()[1]
    set_receive_timeout(server, 60.0)
    with connect_udp(UdpAddress("127.0.0.1", port)) as client:
        data, room, sender = np.arange(9, dtype=np.uint8), np.zeros(9, np.uint8), np.zeros(16, "u1")
        assert native.receive_from_now(server.fileno(), room, sender) == -1
        assert native.send(client.fileno(), data, 7) == 7
        assert native.receive_from(server.fileno(), room, sender) == 7
        assert native.send_to(server.fileno(), data, 3, sender) == 3
        assert native.receive(client.fileno(), room) == 3
        now = native.monotonic_s()
        native.sleep_until(now + 0.01)
        assert native.monotonic_s() >= now + 0.01
"""

LONG_S = 120.0
"""So long that no stall of a busy machine lasts half of it."""


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with bind_udp(UdpAddress("127.0.0.1", 0), "test") as sock:
        set_receive_timeout(sock, LONG_S)
        yield sock


@pytest.fixture
def client(server: socket.socket) -> Iterator[socket.socket]:
    with connect_udp(UdpAddress(*server.getsockname())) as sock:
        set_receive_timeout(sock, LONG_S)
        yield sock


@pytest.fixture
def buffer() -> np.ndarray:
    return np.zeros(280, np.uint8)


def test_datagrams_arrive_with_their_sender_and_can_be_answered(server, client, buffer) -> None:
    data = np.arange(100, dtype=np.uint8)
    sender = np.zeros(native.ADDRESS_SIZE, np.uint8)
    assert native.send(client.fileno(), data, 90) == 90
    assert native.receive_from(server.fileno(), buffer, sender) == 90
    assert buffer[:90].tolist() == list(range(90))
    assert not buffer[90:].any()
    assert address_of(sender) == UdpAddress(*client.getsockname())
    assert native.send_to(server.fileno(), data, 5, sender) == 5
    assert native.receive(client.fileno(), buffer) == 5


def test_long_datagrams_are_cut_to_the_buffer(server, client) -> None:
    client.send(bytes(500))
    assert native.receive(server.fileno(), np.zeros(280, np.uint8)) == 280
    sender = np.zeros(native.ADDRESS_SIZE, np.uint8)
    assert native.receive_from_now(server.fileno(), np.zeros(280, np.uint8), sender) == -1


def test_without_waiting_an_empty_socket_gives_minus_one(server, buffer) -> None:
    sender = np.zeros(native.ADDRESS_SIZE, np.uint8)
    set_receive_timeout(server, LONG_S)
    start = time.monotonic()
    assert native.receive_from_now(server.fileno(), buffer, sender) == -1
    assert native.receive_now(server.fileno(), buffer) == -1
    assert time.monotonic() - start < LONG_S / 2


def test_waiting_ends_at_the_timeout(server, buffer) -> None:
    sender = np.zeros(native.ADDRESS_SIZE, np.uint8)
    set_receive_timeout(server, 0.02)
    for receive in (
        lambda: native.receive(server.fileno(), buffer),
        lambda: native.receive_from(server.fileno(), buffer, sender),
        lambda: native.receive_from_soon(server.fileno(), buffer, sender),
    ):
        start = time.monotonic()
        assert receive() == -1  # and it ends at all, as without a timeout it would not
        assert time.monotonic() - start > 0.019


def test_a_signal_ends_the_wait(server, buffer) -> None:
    set_receive_timeout(server, LONG_S)
    native.sleep_until(native.monotonic_s())  # compiled before the alarm is set
    old = signal.signal(signal.SIGALRM, lambda *_: None)
    try:
        for wait in (
            lambda: native.receive(server.fileno(), buffer),
            lambda: native.sleep_until(native.monotonic_s() + LONG_S),
        ):
            start = time.monotonic()
            signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
            wait()
            assert time.monotonic() - start < LONG_S / 2
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, old)


def test_sending_where_nobody_listens_costs_no_later_datagram(buffer) -> None:
    address = UdpAddress("127.0.0.1", free_ports(1)[0])
    with connect_udp(address) as client:
        assert native.send(client.fileno(), buffer, 10) == 10  # refused, as the next call hears
        with bind_udp(address, "late") as late:
            set_receive_timeout(late, LONG_S)
            assert native.send(client.fileno(), buffer, 20) == 20
            assert native.receive(late.fileno(), buffer) == 20


def test_addresses_are_the_same_if_host_and_port_are() -> None:
    ours = sockaddr(UdpAddress("127.0.0.1", 14601))
    unused = ours.copy()
    unused[8:] = 7
    assert native.same_address(ours, unused)
    for other in (UdpAddress("127.0.0.1", 14602), UdpAddress("127.0.0.2", 14601)):
        assert not native.same_address(ours, sockaddr(other))


def test_failures_are_minus_one(buffer) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unconnected:
        closed = unconnected.detach()
        os.close(closed)
    target = sockaddr(UdpAddress("127.0.0.1", 9))
    assert native.send(closed, buffer, 1) == -1
    assert native.send_to(closed, buffer, 1, target) == -1
    assert native.receive(closed, buffer) == -1


def test_a_receiver_that_does_not_read_never_blocks_the_sender(client, buffer) -> None:
    answers = {native.send(client.fileno(), buffer, 280) for _ in range(5000)}
    assert answers <= {280, -1}


def test_clock_matches_python_and_the_past_is_not_waited_for() -> None:
    before = time.monotonic()
    now = native.monotonic_s()
    native.sleep_until(now - 1.0)
    native.sleep_until(now + 0.01)
    assert before <= now
    assert now + 0.01 <= native.monotonic_s() <= time.monotonic()


def test_plain_python_gives_the_same(tmp_path: Path) -> None:
    assert run_probe(tmp_path, NUMBA_DISABLE_JIT="1") == {}


def test_compiled_callers_are_cached(tmp_path: Path) -> None:
    files = run_probe(tmp_path, NUMBA_DISABLE_JIT="0")
    assert len([name for name in files if ".inner" not in name]) == 7  # functions that are called
    assert run_probe(tmp_path, NUMBA_DISABLE_JIT="0") == files


def run_probe(cache: Path, **environment: str) -> dict[str, int]:
    """Run a program that calls compiled functions; return the times of the files in its cache."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROBE],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)} | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return {path.name: path.stat().st_mtime_ns for path in cache.rglob("*.nbc")}

"""The sockets of a bridge."""

import contextlib
import socket
import sys

import pytest

from ftc_autopilot.foreign.sockets import BridgeSockets, waiting_in
from gcs.scenario.changes import with_changes


@pytest.mark.skipif(sys.platform != "linux", reason="another system has one loopback address")
def test_what_is_sent_to_whoever_had_its_port_before_does_not_come() -> None:
    keys = {"autopilot.kind": "ardupilot", "autopilot.binary": "/bin/true"}
    config = with_changes("paper/scenario1", [], keys, "--set").autopilot_config(3)
    with (
        contextlib.ExitStack() as opened,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        bridge = BridgeSockets(config, opened)
        own = bridge.mavlink
        for host in ("127.0.0.1", own.host):
            other.sendto(host.encode(), (host, own.port))
        ((received, sender),) = waiting_in(bridge.side)
        assert received == own.host.encode()
        bridge.to_autopilot(b"back", sender)
        assert other.recv(100) == b"back"

"""Processor time that a relay needs for a datagram.

    python -m benchmarks.relay

Peers send FTC_STEP_DONE through a relay to a fixed end, which answers each with FTC_SIM_STATE, as
autopilots and plant do in lockstep. Counted is what the process needs beside the thread that sends
and receives here.
"""

import argparse
import contextlib
import socket
import time
from collections.abc import Iterator

from mavlink_defs import dialect
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.capture.relay import Relay, Route
from mavlink_defs.endpoint import UdpAddress, parse_address
from mavlink_defs.framing.frames import FramePacker

LINKS = {
    "counted": None,
    "loss 0 %, delay 0 ms": Impairment(),
    "bit errors 1e-9": Impairment(bit_errors=1e-9),
}
"""What happens to the datagrams, by name; all of them arrive."""

_ANY = UdpAddress("127.0.0.1", 0)


def microseconds(impairment: Impairment | None, peers: int, rounds: int) -> float:
    """Return the processor time of a relay [µs per datagram].

    Args:
        impairment: Of the relayed link.
        peers: How many send in each round.
        rounds: How often each sends.
    """
    with contextlib.ExitStack() as stack:
        end = stack.enter_context(_udp())
        senders = [stack.enter_context(_udp()) for _ in range(peers)]
        address = UdpAddress(*end.getsockname())
        relay = stack.enter_context(Relay([Route("plant", _ANY, address, impairment)]))
        at = parse_address(relay.via[str(address)])
        for sender in senders:
            sender.connect((at.host, at.port))
        _exchange(end, senders, 0)  # every peer is known then
        before = _elsewhere_s()
        for k in range(1, rounds + 1):
            _exchange(end, senders, k)
        return 1e6 * (_elsewhere_s() - before) / (2 * peers * rounds)


@contextlib.contextmanager
def _udp() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(300.0)  # the first datagram waits until code is compiled
        yield sock


def _exchange(end: socket.socket, senders: list[socket.socket], step: int) -> None:
    done = dialect.MAVLink_ftc_step_done_message(step)
    vector = [1.0, 2.0, 3.0]
    state = dialect.MAVLink_ftc_sim_state_message(
        step, 0, vector, vector, vector, vector, vector, step, 1, 7
    )
    for i, sender in enumerate(senders, 1):
        sender.send(FramePacker(i, 1).pack(done))
    for i in range(1, len(senders) + 1):
        end.sendto(FramePacker(i, 25).pack(state), end.recvfrom(4096)[1])
    for sender in senders:
        sender.recv(4096)


def _elsewhere_s() -> float:
    """Return the processor time of all other threads [s]."""
    return time.process_time() - time.thread_time()


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.relay", description=__doc__)
    parser.add_argument("--peers", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=2000)
    options = parser.parse_args()
    for name, impairment in LINKS.items():
        needed = microseconds(impairment, options.peers, options.rounds)
        print(f"{name:22s} {needed:5.1f} us per datagram")


if __name__ == "__main__":
    main()

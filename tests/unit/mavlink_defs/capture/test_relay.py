"""The relay over real loopback sockets."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from mavlink_defs import dialect
from mavlink_defs.capture.impairment import Impairment, Outage
from mavlink_defs.capture.relay import Relay, Route
from mavlink_defs.capture.tap_report import TapReport
from mavlink_defs.endpoint import EndpointError, UdpAddress, parse_address
from mavlink_defs.framing.frames import FramePacker

ANY = UdpAddress("127.0.0.1", 0)
PATIENCE_S = 60.0


@contextlib.contextmanager
def udp() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(PATIENCE_S)
        yield sock


def address_of(sock: socket.socket) -> UdpAddress:
    return UdpAddress(*sock.getsockname())


def front_of(relay: Relay, target: socket.socket | UdpAddress) -> tuple[str, int]:
    address = target if isinstance(target, UdpAddress) else address_of(target)
    at = parse_address(relay.via[str(address)])
    return at.host, at.port


def heartbeat(system: int) -> bytes:
    return FramePacker(system, 1).pack(dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3))


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def nothing_more(sock: socket.socket) -> bool:
    """Whether nothing has arrived, of all that is on its way."""
    sock.settimeout(0.1)
    with contextlib.suppress(TimeoutError):
        return not sock.recv(4096)
    return True


def fate_of(relay: Relay) -> dict[str, Any]:
    (fate,) = [f for f in relay.report().to_json()["fates"] if f["direction"] == "to"]
    return dict(fate)


def frames_of(report: TapReport) -> int:
    return sum(row.frames for row in report.messages)


def has_counted_more(relay: Relay, frames: int) -> bool:
    return frames_of(relay.report()) > frames


def is_in_outage(relay: Relay) -> bool:
    return bool(fate_of(relay)["outage"] == 1)


def test_datagrams_go_both_ways_between_the_right_peers() -> None:
    with (
        udp() as end,
        udp() as a,
        udp() as b,
        Relay([Route("plant", ANY, address_of(end))]) as relay,
    ):
        at = front_of(relay, end)
        seen = {}
        for peer, system in ((a, 1), (b, 2), (a, 1)):
            peer.sendto(heartbeat(system), at)
            datagram, seen[system] = end.recvfrom(4096)
            assert datagram == heartbeat(system)
        assert seen[1] != seen[2]
        end.sendto(b"for 2", seen[2])
        end.sendto(b"for 1", seen[1])
        assert (a.recv(4096), b.recv(4096)) == (b"for 1", b"for 2")
        with relay.counting() as tap:
            streams = {(row.system, row.message): row.frames for row in tap.report().messages}
            assert streams[1, "HEARTBEAT"] == 2
        report = relay.report().to_json()
    links = {(row["link"], row["direction"]): row["datagrams"] for row in report["links"]}
    assert links == {("plant", "to"): 3, ("plant", "from"): 2}
    assert report["links"][0]["dropped"] == {"not MAVLink 2": 2}


def test_between_two_fixed_ends_each_is_heard_from_where_it_is_answered() -> None:
    with udp() as a, udp() as b:
        routes = [Route("formation", ANY, address_of(end)) for end in (a, b)]
        with Relay(routes) as relay:
            for source, target in ((a, b), (b, a), (a, b)):
                source.sendto(heartbeat(1), front_of(relay, target))
                assert target.recvfrom(4096) == (heartbeat(1), front_of(relay, source))
            links = {
                (row["link"], row["direction"]): row["datagrams"]
                for row in relay.report().to_json()["links"]
            }
    assert links == {("formation", "to"): 3}


def test_loss_is_counted_and_what_is_not_lost_arrives() -> None:
    half = Impairment(loss=0.5, seed=7)
    with udp() as end, udp() as peer, Relay([Route("gcs", ANY, address_of(end), half)]) as relay:
        for i in range(200):
            peer.sendto(i.to_bytes(2), front_of(relay, end))
        wait_until(lambda: fate_of(relay)["taken"] == 200)
        fate = fate_of(relay)
        arrived = [end.recv(4096) for _ in range(200 - fate["lost"])]
        assert nothing_more(end)
        assert fate_of(relay)["delivered"] == len(arrived)
    assert 60 < len(arrived) < 140


def test_a_delay_delays_and_keeps_the_order() -> None:
    with udp() as end, udp() as peer:
        route = Route("gcs", ANY, address_of(end), Impairment(delay_ms=100.0, jitter_ms=20.0))
        with Relay([route]) as relay:
            begin = time.monotonic()
            for i in range(20):
                peer.sendto(bytes([i]), front_of(relay, end))
            assert end.recv(4096) == b"\0"
            assert time.monotonic() - begin >= 0.1
            assert [end.recv(4096) for _ in range(1, 20)] == [bytes([i]) for i in range(1, 20)]
            assert nothing_more(end)


def test_outages_count_seconds_or_simulated_time() -> None:
    always = Impairment(outages=(Outage(from_s=0.0, to_s=3600.0),))
    for simulated in (False, True):
        with udp() as end, udp() as peer:
            route = Route("gcs", ANY, address_of(end), always)
            with Relay([route], simulated=simulated) as relay:
                peer.sendto(b"x", front_of(relay, end))
                if simulated:  # no simulated time yet
                    assert end.recv(4096) == b"x"
                else:
                    wait_until(partial(is_in_outage, relay))
                assert nothing_more(end)


def test_a_fixed_end_that_is_not_there_yet_loses_nothing_later() -> None:
    with udp() as later:
        target = address_of(later)
    with udp() as peer, Relay([Route("plant", ANY, target)]) as relay:
        at = parse_address(relay.via[str(target)])
        for _ in range(3):
            peer.sendto(b"early", (at.host, at.port))
            time.sleep(0.02)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            end.bind((target.host, target.port))
            end.settimeout(PATIENCE_S)
            peer.sendto(b"now", (at.host, at.port))
            while end.recv(4096) != b"now":
                pass


def test_an_error_about_the_datagram_before_loses_none() -> None:
    with udp() as end:
        target = address_of(end)
    with udp() as peer, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:

        def gate(_: str, __: str, datagram: bytes) -> bool:
            if datagram == b"refused":  # the next one waits before the relay hears of the error
                peer.sendto(b"x", front_of(relay, target))
            else:
                end.bind((target.host, target.port))
            return True

        relay = Relay([Route("plant", ANY, target)], gate=gate)
        with relay:
            peer.sendto(b"refused", front_of(relay, target))
            end.settimeout(PATIENCE_S)
            wait_until(lambda: end.getsockname()[1] != 0)
            assert end.recv(4096) == b"x"
            assert [fate["undeliverable"] for fate in relay.report().to_json()["fates"]] == [0, 0]


def test_counting_lends_the_tap_soon_however_much_is_sent() -> None:
    with udp() as end, udp() as peer, Relay([Route("gcs", ANY, address_of(end))]) as relay:
        stop = threading.Event()

        def send_all_the_time() -> None:
            while not stop.is_set():
                peer.sendto(heartbeat(1), front_of(relay, end))

        sender = threading.Thread(target=send_all_the_time)
        sender.start()
        try:
            waits = []
            for _ in range(20):
                begin = time.monotonic()
                with relay.counting() as tap:
                    waits.append(time.monotonic() - begin)
                    before = frames_of(tap.report())
                    time.sleep(0.002)
                    assert frames_of(tap.report()) == before  # nothing is counted meanwhile
                wait_until(partial(has_counted_more, relay, before))
            assert sorted(waits)[10] < 0.05
        finally:
            stop.set()
            sender.join()


def test_of_many_peers_the_one_without_traffic_for_longest_is_forgotten(monkeypatch) -> None:
    monkeypatch.setattr("mavlink_defs.capture.relay._MAX_PEERS", 20)
    with contextlib.ExitStack() as stack:
        end = stack.enter_context(udp())
        relay = stack.enter_context(Relay([Route("plant", ANY, address_of(end))]))
        peers = [stack.enter_context(udp()) for _ in range(21)]
        seen = []
        for peer in (*peers[:20], peers[0], peers[20]):
            peer.sendto(b"hello", front_of(relay, end))
            seen.append(end.recvfrom(4096)[1])
        assert seen[20] == seen[0]
        assert len(set(seen)) == 21
        end.sendto(b"for 2", seen[1])  # forgotten: nobody has this port now
        for number in (0, *range(2, 20)):
            end.sendto(b"for %d" % number, seen[number])
            assert peers[number].recv(4096) == b"for %d" % number
        end.sendto(b"for the last", seen[21])
        assert peers[20].recv(4096) == b"for the last"
        assert nothing_more(peers[1])


def test_what_was_in_transit_from_a_forgotten_peer_goes_nowhere(monkeypatch) -> None:
    monkeypatch.setattr("mavlink_defs.capture.relay._MAX_PEERS", 1)
    with udp() as end, udp() as a, udp() as b:
        slow = Route("gcs", ANY, address_of(end), Impairment(delay_ms=50.0))
        with Relay([slow]) as relay:
            a.sendto(b"a", front_of(relay, end))
            wait_until(lambda: fate_of(relay)["taken"] == 1)
            b.sendto(b"b", front_of(relay, end))
            assert end.recv(4096) == b"b"
            assert nothing_more(end)
            assert fate_of(relay)["undeliverable"] == 1


def test_many_long_datagrams_in_transit_arrive_unchanged_and_in_order() -> None:
    sent = [bytes([k]) * (14 * k) for k in range(60)]  # which fit into a socket's buffer together
    slow = Impairment(delay_ms=200.0)
    with udp() as end, udp() as peer, Relay([Route("gcs", ANY, address_of(end), slow)]) as relay:
        for datagram in sent:
            peer.sendto(datagram, front_of(relay, end))
        assert [end.recv(4096) for _ in sent] == sent
        assert nothing_more(end)


def test_a_port_in_use_is_refused_and_nothing_stays_open() -> None:
    with udp() as taken, udp() as end:
        routes = [Route("a", ANY, address_of(end)), Route("b", address_of(taken), address_of(end))]
        with pytest.raises(EndpointError, match="relay of the b link"), Relay(routes):
            pass


def test_no_routes_no_relay() -> None:
    with Relay([]) as relay:
        assert relay.via == {}

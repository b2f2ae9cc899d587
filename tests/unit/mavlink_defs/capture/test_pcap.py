"""The capture reader against a writer of our own, and against Wireshark's own tools."""

import contextlib
import subprocess
from pathlib import Path
from typing import Any

import pytest
from capture_writer import Order, link_header, pcap, pcapng, udp_packet
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs

from mavlink_defs.capture.pcap import Packet, PcapCutOff, PcapError, is_pcap, read_pcap
from mavlink_defs.endpoint import UdpAddress

LINKS = ["null", "loop", "ethernet", "tagged", "raw", "sll", "sll2"]
START_S = 1_750_000_000
A, B = ("127.0.0.1", 40123), ("10.1.2.3", 14560)

times = st.integers(0, 10**6).map(lambda ms: START_S + ms / 1000)
payloads = st.binary(max_size=300)


def read(path: Path, content: bytes) -> list[Packet]:
    path.write_bytes(content)
    return list(read_pcap(path))


def expected(time_s: float, payload: bytes) -> Packet:
    time: Any = pytest.approx(time_s, abs=1e-6)
    return Packet(time, UdpAddress(*A), UdpAddress(*B), payload)


@pytest.mark.parametrize("write", [pcap, pcapng])
@pytest.mark.parametrize("link", LINKS)
@settings(max_examples=25)
@given(
    datagrams=st.lists(st.tuples(times, payloads), max_size=5),
    order=st.sampled_from(["<", ">"]),
    nano=st.booleans(),
)
def test_what_is_written_is_read(
    tmp_path_factory, write, link: str, datagrams, order: Order, nano: bool
) -> None:
    path = tmp_path_factory.getbasetemp() / "a.pcap"
    packets = [(time_s, udp_packet(A, B, payload)) for time_s, payload in datagrams]
    assert read(path, write(packets, link, order, nano)) == [expected(*d) for d in datagrams]
    assert is_pcap(path)


@given(st.data(), st.sampled_from([pcap, pcapng]))
def test_a_file_cut_off_anywhere_gives_what_is_there(tmp_path_factory, data, write) -> None:
    path = tmp_path_factory.getbasetemp() / "a.pcap"
    packets = [(START_S + k, udp_packet(A, B, bytes([k] * 9))) for k in range(3)]
    ends = [len(write(packets[:k], "ethernet")) for k in range(4)]
    size = data.draw(st.integers(ends[0], ends[3]))
    path.write_bytes(write(packets, "ethernet")[:size])
    found: list[Packet] = []
    whole = contextlib.nullcontext()
    with whole if size in ends else pytest.raises(PcapCutOff, match=str(path)):
        for packet in read_pcap(path):
            found.append(packet)
    assert len(found) == sum(end <= size for end in ends[1:])


@given(noise=st.binary(max_size=200), magic=st.sampled_from([pcap([], "null"), pcapng([], "raw")]))
def test_noise_after_a_good_begin_gives_packets_or_one_kind_of_error(
    tmp_path_factory, noise: bytes, magic: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "a.pcap"
    with contextlib.suppress(PcapError):
        read(path, magic + noise)


def test_padding_and_snapped_payloads(tmp_path: Path) -> None:
    ip = udp_packet(A, B, b"abc")
    packets = [(START_S, ip + bytes(14)), (START_S, ip[:-2])]
    found = [packet.payload for packet in read(tmp_path / "a", pcap(packets, "ethernet"))]
    assert found == [b"abc", b"a"]


def test_what_is_no_udp_datagram_over_ipv4_is_passed_over(tmp_path: Path) -> None:
    good = udp_packet(A, B, b"x")
    tcp = good[:9] + b"\x06" + good[10:]
    fragment = good[:6] + b"\x20\x00" + good[8:]
    ipv6 = b"\x60" + good[1:]
    packets = [(START_S, ip) for ip in (tcp, fragment, ipv6, b"", good[:10], good)]
    assert len(read(tmp_path / "a", pcap(packets, "raw"))) == 1
    arp = pcap([(START_S, good)], "ethernet").replace(
        link_header("ethernet"), link_header("ethernet", kind=0x0806)
    )
    assert read(tmp_path / "a", arp) == []


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    for content in (b"", b"abc", b"no capture at all"):
        path.write_bytes(content)
        assert not is_pcap(path)
        with pytest.raises(PcapError, match="no packet capture"):
            list(read_pcap(path))
    wifi = bytearray(pcap([(START_S, b"")], "raw"))
    wifi[20] = 105
    with pytest.raises(PcapError, match="link type 105"):
        read(path, bytes(wifi))


@needs("editcap")
@pytest.mark.parametrize("kind", ["pcap", "nsecpcap", "pcapng"])
def test_files_that_wireshark_writes_are_read(tmp_path: Path, kind: str) -> None:
    times_s = [START_S + 0.25 * k for k in range(3)]
    source, made = tmp_path / "source", tmp_path / "made"
    source.write_bytes(pcap([(t, udp_packet(A, B, b"abc")) for t in times_s], "sll"))
    subprocess.run(["editcap", "-F", kind, source, made], check=True, timeout=300)
    assert list(read_pcap(made)) == [expected(t, b"abc") for t in times_s]

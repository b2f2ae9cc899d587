"""Packet captures: the UDP datagrams in a pcap or pcapng file, as tcpdump and Wireshark write.

Both byte orders, times in micro- or nanoseconds, and the link types below; IPv4 only. Packets
that are no whole UDP datagram (other protocols, fragments) are skipped, and counted. The formats:
draft-ietf-opsawg-pcap, draft-ietf-opsawg-pcapng, https://www.tcpdump.org/linktypes.html.

The reader is part of this project because dpkt, which has one, was last released in 2022.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mavlink_defs.config.user_files import open_file
from mavlink_defs.endpoint import UdpAddress

_PCAP = {  # magic as read in little endian: byte order, parts of a second
    0xA1B2C3D4: ("<", 1e-6),
    0xA1B23C4D: ("<", 1e-9),
    0xD4C3B2A1: (">", 1e-6),
    0x4D3CB2A1: (">", 1e-9),
}
_PCAPNG = 0x0A0D0D0A  # type of a section header, the same in both byte orders
_BYTE_ORDER = 0x1A2B3C4D
_MAX_BLOCK = 1 << 26  # bytes; more is a damaged length
_IPV4, _UDP = 0x0800, 17
_PROTOCOLS = {1: "ICMP", 2: "IGMP", 6: "TCP"}
_VLAN = {0x8100, 0x88A8}


class PcapError(ValueError):
    """The file cannot be read as a packet capture; the message names the reason."""


class PcapCutOff(PcapError):  # noqa: N818 - the name says it
    """The file ends within a packet; the packets before it are readable."""


class Packet(NamedTuple):
    """One UDP datagram; its payload is shorter than it was if the capture has a snapshot length."""

    time_s: float  # since 1970
    source: UdpAddress
    destination: UdpAddress
    payload: bytes


def is_pcap(path: Path) -> bool:
    """Return whether a file begins like a packet capture.

    Raises:
        OSError: The file cannot be read.
    """
    with open_file(path) as file:
        head = file.read(4)
    return len(head) == 4 and struct.unpack("<I", head)[0] in {*_PCAP, _PCAPNG}


def read_pcap(path: Path, skipped: Counter[str] | None = None) -> Iterator[Packet]:
    """Read the UDP datagrams of a pcap or pcapng file, in its order.

    Args:
        path: The file.
        skipped: Counts the other packets, by what they are.

    Raises:
        PcapCutOff: After everything else, if the file ends within a packet.
        PcapError: The file is something else, damaged, or has a link type that is not known.
        OSError: The file cannot be read.
    """
    with open_file(path) as file:
        magic = file.read(4)
        file.seek(0)
        number = struct.unpack("<I", magic)[0] if len(magic) == 4 else 0
        try:
            if number in _PCAP:
                packets = _read_classic(file, *_PCAP[number])
            elif number == _PCAPNG:
                packets = _read_blocks(file)
            else:
                raise PcapError("no packet capture")
            for link_type, time_s, data in packets:
                packet = _datagram(link_type, time_s, data)
                if isinstance(packet, Packet):
                    yield packet
                elif skipped is not None:
                    skipped[packet] += 1
        except PcapError as exc:
            raise type(exc)(f"{path}: {exc}") from None


def _read_classic(file: BinaryIO, order: str, unit_s: float) -> Iterator[tuple[int, float, bytes]]:
    head = _exactly(file, 24)
    link_type = struct.unpack(order + "I", head[20:])[0] & 0x0FFFFFFF
    record = struct.Struct(order + "IIII")
    while not _at_end(file):
        seconds, parts, size, _ = record.unpack(_exactly(file, record.size))
        if size > _MAX_BLOCK:
            raise PcapError(f"damaged: a packet of {size} bytes")
        yield link_type, seconds + parts * unit_s, _exactly(file, size)


class _Interface(NamedTuple):
    link_type: int
    unit_s: float
    offset_s: int


def _read_blocks(file: BinaryIO) -> Iterator[tuple[int, float, bytes]]:
    order, interfaces = "<", list[_Interface]()
    while not _at_end(file):
        start = _exactly(file, 8)
        if struct.unpack("<I", start[:4])[0] == _PCAPNG:
            mark = _exactly(file, 4)
            order = "<" if struct.unpack("<I", mark)[0] == _BYTE_ORDER else ">"
            if struct.unpack(order + "I", mark)[0] != _BYTE_ORDER:
                raise PcapError("damaged: a section without a byte order")
            interfaces = []
            _body(file, order, start, 12)
            continue
        kind = struct.unpack(order + "I", start[:4])[0]
        body = _body(file, order, start, 8)
        try:
            if kind == 1:
                interfaces.append(_interface(order, body))
            elif kind == 6:  # enhanced packet
                i, high, low, size = struct.unpack_from(order + "IIII", body)
                yield _timed(interfaces[i], high << 32 | low, body[20 : 20 + size])
            elif kind == 2:  # packet, obsolete
                i, high, low, size = struct.unpack_from(order + "H2xIII", body)
                yield _timed(interfaces[i], high << 32 | low, body[20 : 20 + size])
            elif kind == 3:  # simple packet: no time
                (size,) = struct.unpack_from(order + "I", body)
                yield interfaces[0].link_type, 0.0, body[4 : 4 + size]
        except (struct.error, IndexError) as exc:
            raise PcapError(f"damaged: a block of type {kind} with wrong content") from exc


def _body(file: BinaryIO, order: str, start: bytes, consumed: int) -> bytes:
    size = struct.unpack(order + "I", start[4:])[0]
    if not 12 <= size <= _MAX_BLOCK or size % 4:
        raise PcapError(f"damaged: a block of {size} bytes")
    return _exactly(file, size - consumed)[:-4]  # the size once more


def _interface(order: str, body: bytes) -> _Interface:
    (link_type,) = struct.unpack_from(order + "H", body)
    unit_s, offset_s, at = 1e-6, 0, 8
    while at + 4 <= len(body):
        code, size = struct.unpack_from(order + "HH", body, at)
        value = body[at + 4 : at + 4 + size]
        if code == 9 and value:  # if_tsresol
            unit_s = 2.0 ** -(value[0] & 0x7F) if value[0] & 0x80 else 10.0 ** -value[0]
        elif code == 14 and size == 8:  # if_tsoffset
            (offset_s,) = struct.unpack(order + "q", value)
        at += 4 + (size + 3) // 4 * 4
    return _Interface(link_type, unit_s, offset_s)


def _timed(interface: _Interface, time: int, data: bytes) -> tuple[int, float, bytes]:
    return interface.link_type, interface.offset_s + time * interface.unit_s, data


def _at_end(file: BinaryIO) -> bool:
    byte = file.read(1)
    file.seek(-len(byte), 1)
    return not byte


def _exactly(file: BinaryIO, size: int) -> bytes:
    at = file.tell()
    data = file.read(size)
    if len(data) < size:
        raise PcapCutOff(f"cut off at byte {at}")
    return data


def _datagram(link_type: int, time_s: float, data: bytes) -> Packet | str:
    """Return the UDP datagram in a captured packet; what it is if it holds none."""
    ip = _network_layer(link_type, data)
    if len(ip) < 20 or ip[0] >> 4 != 4:
        return "not IPv4"
    if ip[9] != _UDP:
        return _PROTOCOLS.get(ip[9], f"IP protocol {ip[9]}")
    head = 4 * (ip[0] & 0x0F)
    if struct.unpack_from("!H", ip, 6)[0] & 0x3FFF:
        return "fragments"
    if head < 20 or len(ip) < head + 8:
        return "damaged"
    source, destination, size = struct.unpack_from("!HHH", ip, head)
    if not (source and destination and size >= 8):
        return "damaged"
    return Packet(
        time_s,
        UdpAddress(".".join(map(str, ip[12:16])), source),
        UdpAddress(".".join(map(str, ip[16:20])), destination),
        ip[head + 8 : head + size],
    )


def _network_layer(link_type: int, data: bytes) -> bytes:
    """Return the bytes behind the link layer's header if they are IPv4, else none.

    Raises:
        PcapError: The link type is not known.
    """
    match link_type:
        case 1:  # Ethernet, perhaps with tags
            at = 12
            while int.from_bytes(data[at : at + 2]) in _VLAN:
                at += 4
            return data[at + 2 :] if int.from_bytes(data[at : at + 2]) == _IPV4 else b""
        case 0 | 108:  # BSD loopback: the address family, in either byte order; AF_INET is 2
            return data[4:] if data[:4] in {b"\2\0\0\0", b"\0\0\0\2"} else b""
        case 12 | 14 | 101 | 228:  # raw IP
            return data
        case 113:  # Linux cooked capture
            return data[16:] if int.from_bytes(data[14:16]) == _IPV4 else b""
        case 276:  # Linux cooked capture, version 2
            return data[20:] if int.from_bytes(data[:2]) == _IPV4 else b""
    raise PcapError(f"its link type {link_type} is not known; capture Ethernet, loopback or 'any'")

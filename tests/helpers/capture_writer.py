"""Writes captures for tests: pcap and pcapng, any byte order and link type of the reader's."""

import socket
import struct
from collections.abc import Sequence
from typing import Literal

Order = Literal["<", ">"]
Ends = tuple[tuple[str, int], tuple[str, int]]
LINK_TYPES = {"null": 0, "ethernet": 1, "raw": 101, "loop": 108, "sll": 113, "sll2": 276}


def udp_packet(source: tuple[str, int], destination: tuple[str, int], payload: bytes) -> bytes:
    """An IPv4 packet; checksums are left 0."""
    udp = struct.pack("!HHHH", source[1], destination[1], 8 + len(payload), 0) + payload
    addresses = socket.inet_aton(source[0]) + socket.inet_aton(destination[0])
    head = struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(udp), 7, 0x4000, 64, 17, 0)
    return head + addresses + udp


def link_header(link: str, order: Order = "<", kind: int = 0x0800) -> bytes:
    return {
        "null": struct.pack(order + "I", 2),
        "loop": struct.pack("!I", 2),
        "ethernet": bytes(12) + struct.pack("!H", kind),
        "tagged": bytes(12) + struct.pack("!HHH", 0x8100, 5, kind),
        "raw": b"",
        "sll": struct.pack("!HHH8xH", 0, 772, 6, kind),
        "sll2": struct.pack("!HHIHBB8x", kind, 0, 1, 772, 0, 6),
    }[link]


def pcap(
    packets: Sequence[tuple[float, bytes]], link: str, order: Order = "<", nano: bool = False
) -> bytes:
    magic, parts = (0xA1B23C4D, 1e9) if nano else (0xA1B2C3D4, 1e6)
    number = LINK_TYPES["ethernet" if link == "tagged" else link]
    out = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 262_144, number)
    for time_s, ip in packets:
        data = link_header(link, order) + ip
        part = round(time_s % 1 * parts) % int(parts)
        out += struct.pack(order + "IIII", int(time_s), part, len(data), len(data)) + data
    return out


def pcapng(
    packets: Sequence[tuple[float, bytes]], link: str, order: Order = "<", nano: bool = False
) -> bytes:
    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        size = struct.pack(order + "I", 12 + len(body))
        return struct.pack(order + "I", kind) + size + body + size

    number = LINK_TYPES["ethernet" if link == "tagged" else link]
    options = struct.pack(order + "HHB3xHH", 9, 1, 9, 0, 0) if nano else b""
    out = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack(order + "HHI", number, 0, 0) + options)
    for time_s, ip in packets:
        data = link_header(link, order) + ip
        time = round(time_s * (1e9 if nano else 1e6))
        head = struct.pack(order + "IIIII", 0, time >> 32, time & 0xFFFFFFFF, len(data), len(data))
        out += block(6, head + data)
    return out

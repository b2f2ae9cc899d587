"""The frames in what a foreign autopilot sends, of our dialect and of others."""

from mavlink_defs.framing.frames import frame_size
from mavlink_defs.framing.header import V2_MAGIC, whole_size


def frames_in(datagram: bytes) -> list[bytes]:
    """Return the frames of the dialect in a datagram; what is something else is passed over."""
    found, rest = [], datagram
    while rest:
        size = whole_size(rest, len(rest)) if rest[0] == V2_MAGIC else 0
        if size <= 0:
            rest = rest[max(rest.find(bytes([V2_MAGIC]), 1), 0) or len(rest) :]
            continue
        frame, rest = rest[:size], rest[size:]
        if frame_size(frame)[0] == size:
            found.append(frame)
    return found

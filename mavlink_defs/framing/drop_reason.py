"""Why a datagram is dropped."""

from enum import IntEnum


class DropReason(IntEnum):
    """Why a datagram is dropped, in the order of the arrays of FTC_DROPS.

    The numbers are negative, so that compiled code can return a message id or a reason, and
    they begin behind `codec.FOREIGN` and `codec.SIGNED`.
    """

    TRUNCATED = -3, "truncated"
    BAD_MAGIC = -4, "not MAVLink 2"
    BAD_LENGTH = -5, "bytes after the frame"
    BAD_FLAGS = -6, "unknown incompatibility flags"
    BAD_CRC = -7, "wrong checksum"
    UNEXPECTED = -8, "unknown message"
    STRANGER = -9, "wrong sender"
    OTHER_TARGET = -10, "wrong target"
    NOT_NEWER = -11, "not newer"
    OUT_OF_RANGE = -12, "out of range"
    WRONG_SIGNATURE = -13, "wrong signature"
    UNSIGNED = -14, "unsigned"
    REPLAYED = -15, "replayed"

    text: str
    """The reason, as reports name it."""

    def __new__(cls, number: int, text: str) -> "DropReason":
        """Make a member with the given number as its value."""
        reason = int.__new__(cls, number)
        reason._value_ = number
        reason.text = text
        return reason

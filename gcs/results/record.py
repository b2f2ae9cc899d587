"""The choice of what is recorded."""

from enum import StrEnum


class Record(StrEnum):
    """How much of a flight is kept; every one has the figures of `summary.json`."""

    FULL = "full"
    LIGHT = "light"
    NPZ = "npz"
    NONE = "none"

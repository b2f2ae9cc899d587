"""What users choose about recordings."""

from enum import StrEnum


class Record(StrEnum):
    """How much of a flight is kept; every one has the figures of `summary.json`."""

    FULL = "full"
    LIGHT = "light"
    NPZ = "npz"
    NONE = "none"


class Format(StrEnum):
    """A format that recordings are converted to."""

    NPZ = "npz"
    CSV = "csv"
    PARQUET = "parquet"
    KML = "kml"
    MCAP = "mcap"
    ULG = "ulg"

"""Formats of other programs."""

from enum import StrEnum


class Format(StrEnum):
    """A format that recordings are converted to."""

    CSV = "csv"
    PARQUET = "parquet"
    KML = "kml"
    MCAP = "mcap"

"""The errors that programs catch; `gcs` has them as well."""

from gcs.console.errors import BadInput, CommandRefused, FlightLost, GcsError, Interrupted, NoAnswer

__all__ = ["BadInput", "CommandRefused", "FlightLost", "GcsError", "Interrupted", "NoAnswer"]

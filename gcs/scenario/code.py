"""The code that turns a scenario into figures, by its digest and version."""

import functools
from importlib.metadata import version
from pathlib import Path

from mavlink_defs.runtime.sources import source_digest

_ROOT = Path(__file__).parents[2]
_SOURCES = (
    "mavlink_defs/**/*.py",
    "mavlink_defs/*.xml",
    "sitl_plant/**/*.py",
    "ftc_autopilot/**/*.py",
    "ftc_lab/campaigns/flights.py",
    "gcs/fleet/in_process.py",
    "gcs/results/*.py",
    "gcs/scenario/*.py",
)
"""The sources that a flight's figures depend on, below `_ROOT`."""


@functools.cache
def code_digest() -> str:
    """Return a digest of the sources and of the versions of numba and numpy."""
    return source_digest(sorted(path for pattern in _SOURCES for path in _ROOT.glob(pattern)))[:16]


@functools.cache
def code_version() -> str:
    """Return the version of the package."""
    return version("ftc-sitl")

"""The user's signing key for a scenario's links, and the warning about exposed ports."""

import contextlib
import sys
from pathlib import Path

from gcs.errors import BadInput
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, exposed, is_loopback
from mavlink_defs.framing.signing import SigningError, read_key

__all__ = ["signed", "warn_if_exposed"]


def signed(scenario: Scenario, path: str | None) -> Scenario:
    """Return the scenario with another key file; unchanged if `path` is None.

    Raises:
        BadInput: The key file, or that of the scenario, cannot be used.
    """
    if path is not None:
        scenario = scenario.signed(Path(path))
    if scenario.links.signing_key is not None:
        try:
            read_key(scenario.links.signing_key)
        except SigningError as problem:
            raise BadInput(str(problem)) from None
    return scenario


def warn_if_exposed(address: UdpAddress, with_key: bool) -> None:
    """Warn on standard error if a port to be bound can be reached from other machines."""
    with contextlib.suppress(EndpointError):  # binding it will report the error
        if not is_loopback(address):
            print(exposed(address, with_key), file=sys.stderr)

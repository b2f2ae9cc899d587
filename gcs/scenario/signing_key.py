"""The user's signing key for a scenario's links."""

import contextlib
from pathlib import Path

from gcs.errors import BadInput
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, is_loopback
from mavlink_defs.framing.signing import SigningError, read_key


def signed(scenario: Scenario, path: str | None) -> Scenario:
    """Return the scenario with another key file; unchanged if `path` is None.

    Raises:
        BadInput: The key file, or the scenario's, cannot be used.
    """
    if path is not None:
        scenario = scenario.signed(Path(path))
    if scenario.links.signing_key is not None:
        try:
            read_key(scenario.links.signing_key)
        except SigningError as problem:
            raise BadInput(str(problem)) from None
    return scenario


def refuse_unsigned(scenario: Scenario) -> None:
    """Refuse links without a key on an address that other machines can reach.

    Raises:
        BadInput: `links.host` is such an address, and there is no key.
    """
    links = scenario.links
    if links.signing_key is not None:
        return
    with contextlib.suppress(EndpointError):  # binding it will report the error
        if not is_loopback(UdpAddress(links.host, links.gcs_port)):
            raise BadInput(
                f"links.host is {links.host}, which other machines can reach, and "
                "links.signing_key is not set: anyone there could fly the fleet",
                "make a key with `gcs key FILE` and give --signing-key FILE; or set links.host to "
                "127.0.0.1; or accept it with --insecure",
            )

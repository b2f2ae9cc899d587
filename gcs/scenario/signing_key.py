"""The user's signing key for a scenario's links."""

from collections.abc import Mapping
from pathlib import Path

from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import EndpointError, UdpAddress, is_loopback
from mavlink_defs.framing.signing import SigningError, read_key


def signed(scenario: Scenario, path: Path | str | None) -> Scenario:
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


def refuse_unsigned(scenario: Scenario, hosts: Mapping[str, str] | None = None) -> None:
    """Refuse links without a key on an address that other machines can reach.

    Args:
        scenario: The scenario; all its processes are on `links.host`.
        hosts: Where they are instead: addresses or names of hosts, by what `--host` calls them.

    Raises:
        BadInput: One is such an address, and there is no key.
    """
    links = scenario.links
    if links.signing_key is not None:
        return
    setting = "links.host" if hosts is None else "--host"
    for name, host in ({"": links.host} if hosts is None else hosts).items():
        try:
            if is_loopback(UdpAddress(host, links.gcs_port)):
                continue
        except EndpointError:
            if hosts is None:
                continue  # binding it will report the error
        at = f"of {name} " if name else ""
        raise BadInput(
            f"{setting} {at}is {host}, which other machines can reach, and "
            "links.signing_key is not set: anyone there could fly the fleet",
            f"make a key with `gcs key FILE` and give --signing-key FILE; or set {setting} to "
            "127.0.0.1; or accept it with --insecure",
        )

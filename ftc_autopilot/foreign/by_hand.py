"""An ArduPlane that somebody starts by hand: where it finds its bridge, and how it is started."""

import os
import shlex
from pathlib import Path
from typing import NamedTuple

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.kinds import ArduPlaneAutopilot
from mavlink_defs.endpoint import UdpAddress, parse_address
from sitl_plant.foreign.ardupilot.config import PORTS_APART
from sitl_plant.foreign.ardupilot.parameters import parameter_text, parameters_of


class Waiting(NamedTuple):
    """Where a bridge waits for its program."""

    physics: UdpAddress
    mavlink: UdpAddress


def waiting(config: AutopilotConfig) -> Waiting | None:
    """Return where a bridge waits for its program; None of one that starts it."""
    own = config.autopilot
    if not isinstance(own, ArduPlaneAutopilot) or own.binary is not None:
        return None
    host, port = parse_address(config.formation_bind).host, own.port + PORTS_APART * (config.id - 1)
    return Waiting(UdpAddress(host, port), UdpAddress(host, port + 1))


def instruction(config: AutopilotConfig) -> str:
    """Write the parameters of a program that is started by hand; return the line that starts it.

    Raises:
        OSError: The parameters cannot be written; the file is named.
    """
    at = waiting(config)
    assert at is not None
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "ftc-sitl"
    cache.mkdir(parents=True, exist_ok=True)
    derived = cache / f"arduplane-{at.physics.port}.parm"
    command = ["arduplane", "-I", str(config.id - 1), *arguments(config, *at, derived)]
    return f"UAV {config.id} waits for an ArduPlane: {shlex.join(command)}"


def arguments(
    config: AutopilotConfig,
    physics: UdpAddress,
    mavlink: UdpAddress,
    derived: Path,
    beside: str = "",
) -> list[str]:
    """Return what an ArduPlane needs to find its bridge, and to fly the aircraft.

    Args:
        config: The configuration of its bridge.
        physics: Where its frames go to.
        mavlink: Where its MAVLink goes to.
        derived: File for the parameters that follow from the aircraft; the user's come after it.
        beside: Others, as lines, that go into that file.

    Raises:
        OSError: The file cannot be written; it is named.
    """
    own, home = config.autopilot, config.origin
    assert isinstance(own, ArduPlaneAutopilot)
    found = parameters_of(config.aircraft, own.outputs, config.step_us)
    derived.write_text(parameter_text(found) + beside)
    users = [] if own.defaults is None else [Path(own.defaults).expanduser().resolve()]
    return [
        "--model", f"JSON:{physics.host}",
        "--sim-port-out", str(physics.port),
        "--serial0", f"udpclient:{mavlink}",
        "--sysid", str(config.id),
        "--home", f"{home.latitude_deg:.9f},{home.longitude_deg:.9f},{home.altitude_m:.3f},0",
        "--defaults", ",".join(map(str, [derived, *users])),
    ]  # fmt: skip

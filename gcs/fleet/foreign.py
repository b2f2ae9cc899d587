"""What has to be there to fly a scenario with foreign autopilots."""

import os
from collections.abc import Iterator
from pathlib import Path

from ftc_autopilot.kinds import Px4Autopilot
from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario


def to_start(scenario: Scenario) -> Iterator[str]:
    """Yield a line on each program that the user starts by hand, with its arguments."""
    if not scenario.foreign:
        return
    from ftc_autopilot.foreign.by_hand import instruction, waiting

    for uav in scenario.foreign:
        config = scenario.autopilot_config(uav)
        if waiting(config) is not None:
            yield instruction(config)


def check_foreign(scenario: Scenario, *, over_udp: bool, attended: bool = False) -> None:
    """Check that the programs of foreign autopilots can be started, before any process is.

    Args:
        scenario: The scenario.
        over_udp: Whether it is flown with processes.
        attended: Whether somebody is there to start a program by hand.

    Raises:
        BadInput: One cannot, or the flight is in process.
    """
    for uav, own in scenario.foreign.items():
        if not over_udp:
            text = f"UAV {uav} has autopilot.kind: {own.kind}, a program that flies as a process"
            raise BadInput(f"{text}; a flight in process has none", "fly it over UDP")
        if own.binary is not None:
            _check_binary(uav, own.kind, own.binary)
        elif not attended:
            text = f"autopilot.binary of UAV {uav} is missing: many flights start it themselves"
            raise BadInput(text, f"name the program, as with --autopilot {own.kind}=PATH")
        if isinstance(own, Px4Autopilot):
            _check_startup(uav, own)
        elif own.defaults is not None and not Path(own.defaults).expanduser().is_file():
            what = f"autopilot.defaults of UAV {uav} is {own.defaults}"
            raise BadInput(f"{what}: there is no such file in {Path.cwd()}")


def _check_binary(uav: int, kind: str, binary: str) -> None:
    path, what = Path(binary).expanduser(), f"autopilot.binary of UAV {uav} is {binary}"
    if not path.is_file():
        text = f"{what}: there is no such file in {Path.cwd()}"
        raise BadInput(text, f"name the program of {kind}, built for SITL")
    if not os.access(path, os.X_OK):
        raise BadInput(f"{what}: it cannot be executed", f"chmod +x {path}")


def _check_startup(uav: int, own: Px4Autopilot) -> None:
    """Check that a PX4 has its startup scripts."""
    folder = own.startup
    if not (folder / "init.d-posix" / "rcS").is_file():
        text = f"autopilot of UAV {uav}: there is no init.d-posix/rcS in {folder}"
        raise BadInput(text, "set its key data to the folder etc of the build")

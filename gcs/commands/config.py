"""``gcs config``: configuration files for the processes of a fleet on several hosts."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

import typer

from ftc_autopilot.config import AutopilotConfig
from gcs.commands.common import ScenarioArgument, SetOption, WithOption, changed_scenario, tell
from gcs.commands.options import InsecureOption, SigningKeyOption
from gcs.console.errors import BadInput
from gcs.console.lines import print_line
from gcs.console.outputs import all_or_none, make_folder
from gcs.console.terminal import console_of
from gcs.fleet.warm_up import warm_up
from gcs.scenario.model import Scenario
from gcs.scenario.plugins import prepare_plugins
from gcs.scenario.signing_key import refuse_unsigned, signed
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import EndpointError, parse_address
from sitl_plant.config import PlantConfig


def config(
    scenario: ScenarioArgument,
    out: Annotated[Path, typer.Option(metavar="FOLDER")],
    host: Annotated[list[str] | None, typer.Option(metavar="NAME=HOST")] = None,
    additions: WithOption = None,
    settings: SetOption = None,
    signing_key: SigningKeyOption = None,
    insecure: InsecureOption = False,
) -> None:
    """Write the configurations of a fleet that spans several hosts.

    The folder gets plant.yaml, and uav1.yaml and so on. Run the same command on every host: it
    also compiles the numeric core there. Then start one process per file by hand: nothing here
    starts them. The plant flies in real time until it is stopped. Links that other machines can
    reach must be signed, unless --insecure is given.

    Args:
        out: Folder for the files; files of the same names are replaced.
        host: Address of the host of `plant`, `gcs` or a UAV (`uav1`); links.host of the scenario
            for the others; may be repeated.

    Examples:
        - gcs config paper/scenario1 --out fleet --host plant=10.0.0.1 --host gcs=10.0.0.9
          --host uav1=10.0.0.1 --host uav2=10.0.0.2 --host uav3=10.0.0.2 --signing-key fleet.key

    Exit status: 0 written, 1 a file cannot be written, 2 bad input.
    """
    loaded = signed(changed_scenario(scenario, additions, settings), signing_key)
    if loaded.links.impairments is not None:
        text = "links.impairments need the relays of `gcs fly` and `gcs up`"
        raise BadInput(text, "take them out of the scenario")
    hosts = _hosts(loaded, host or [])
    if not insecure:
        refuse_unsigned(loaded, hosts)
    moved = _moved_addresses(loaded, hosts)
    make_folder(out)
    plant, files = out / "plant.yaml", {uav.id: out / f"uav{uav.id}.yaml" for uav in loaded.uavs}
    with all_or_none([plant, *files.values()]):
        dump(_plant(loaded, moved), plant)
        for uav_id, file in files.items():
            dump(_autopilot(loaded, uav_id, moved), file)
    tell(prepare_plugins(loaded), console_of())
    warm_up(None, console_of())
    for name, address in hosts.items():
        program = {"plant": "sitl-plant", "gcs": "gcs"}.get(name, "ftc-autopilot")
        station = f"--connect udpin:{address}:{loaded.links.gcs_port}"
        print_line(f"on {address}: {program} {station if name == 'gcs' else out / f'{name}.yaml'}")


def _hosts(scenario: Scenario, options: Iterable[str]) -> dict[str, str]:
    """Return the host of each process by its name, given the ``--host`` options."""
    names = ["plant", *(f"uav{uav.id}" for uav in scenario.uavs), "gcs"]
    hosts = dict.fromkeys(names, scenario.links.host)
    for option in options:
        name, _, host = option.partition("=")
        if name not in names:
            raise BadInput(f"--host is {option!r}, expected NAME=HOST, NAME of {', '.join(names)}")
        try:
            hosts[name] = parse_address(f"{host}:1").host
        except EndpointError:
            text = f"--host is {option!r}, expected an IPv4 address or a host name after the ="
            raise BadInput(text) from None
    return hosts


def _moved_addresses(scenario: Scenario, hosts: Mapping[str, str]) -> dict[str, str]:
    """Return the address on its own host for each address on the scenario's single host."""
    links = scenario.links
    ports = {"plant": links.plant_port, "gcs": links.gcs_port}
    ports |= {f"uav{uav.id}": links.formation_base_port + uav.id for uav in scenario.uavs}
    return {links.address(port): f"{hosts[name]}:{port}" for name, port in ports.items()}


def _plant(scenario: Scenario, moved: Mapping[str, str]) -> PlantConfig:
    plant = scenario.plant_config(speed=1.0, endless=True)
    return plant.model_copy(update={"bind": moved[plant.bind]})


def _autopilot(scenario: Scenario, uav_id: int, moved: Mapping[str, str]) -> AutopilotConfig:
    from gcs.fleet.relays import through

    autopilot = through(scenario.autopilot_config(uav_id), moved)
    return autopilot.model_copy(update={"formation_bind": moved[autopilot.formation_bind]})

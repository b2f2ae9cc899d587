"""Dockerfile and compose.yaml, as far as they can be tested without a container engine."""

import ipaddress
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from flying import BIN, run
from packaging.requirements import Requirement

from ftc_autopilot.config import AutopilotConfig
from gcs.commands.cli import app
from mavlink_defs.config.files import load
from mavlink_defs.endpoint import parse_address, parse_connection
from sitl_plant.config import PlantConfig

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())
SERVICES: dict[str, Any] = COMPOSE["services"]
STARTED = ("plant", "uav1", "uav2", "uav3")


def address_of(service: str) -> str:
    (network,) = SERVICES[service]["networks"].values()
    return str(network["ipv4_address"])


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that the service `config` writes into the volume /fleet."""
    folder = tmp_path_factory.mktemp("fleet")
    program, *arguments = SERVICES["config"]["command"]
    arguments = [argument.replace("/fleet", str(folder)) for argument in arguments]
    done = run(program, *arguments)
    assert done.returncode == 0, done.stderr
    return folder


def test_hadolint_has_nothing_to_say() -> None:
    done = subprocess.run(
        [BIN / "hadolint", ROOT / "Dockerfile"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_image_gets_the_locked_versions() -> None:
    """The requirements.txt that sed makes is understood by pip, and has every dependency."""
    (script,) = re.findall(r"sed -n '(.*)' requirements\.txt", (ROOT / "Dockerfile").read_text())
    requirements = ROOT / "requirements.txt"
    made = subprocess.run(
        ["sed", "-n", script, requirements], capture_output=True, text=True, check=True
    )
    locked = [Requirement(line).name.lower() for line in made.stdout.splitlines()]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    needed = [*project["dependencies"], *(text for extra in extras for text in extra)]
    assert {Requirement(text).name.lower() for text in needed} <= {*locked}
    assert len(locked) == len(re.findall(r"^\w", requirements.read_text(), re.MULTILINE))


def test_the_image_gets_every_extra() -> None:
    """What a command of the documentation needs is there, as nothing can be installed later."""
    (extras,) = re.findall(r"/dist/\*\.whl\)\[(.*?)\]", (ROOT / "Dockerfile").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert extras.split(",") == sorted(project["optional-dependencies"])


def test_the_image_gets_all_that_the_wheel_is_built_from() -> None:
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    sent = {line.removeprefix("!") for line in lines if line.startswith("!")}
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wheel = pyproject["tool"]["hatch"]["build"]["targets"]["wheel"]
    project = pyproject["project"]
    needed = {"pyproject.toml", "requirements.txt", "scenarios", "aircraft", project["readme"]}
    needed.add("scripts/prebuild.py")
    needed |= {*wheel["packages"], wheel["hooks"]["custom"]["path"], *project["license-files"]}
    assert sent == needed
    assert all((ROOT / path).exists() for path in sent)


def test_every_command_exists_with_its_options() -> None:
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert all(service["command"][0] in scripts for service in SERVICES.values())
    group: Any = typer.main.get_command(app)
    for service in ("config", "gcs"):
        _, *arguments = SERVICES[service]["command"]
        with group.make_context("gcs", arguments, resilient_parsing=not arguments) as context:
            if arguments:
                name, command, rest = group.resolve_command(context, arguments)
                command.make_context(name, rest, parent=context).close()


def test_each_process_finds_its_file_and_its_own_address(fleet: Path) -> None:
    assert {path.stem for path in fleet.iterdir()} == set(STARTED)
    for name in STARTED:
        program, file = SERVICES[name]["command"]
        config = Path(file.replace("/fleet", str(fleet)))
        if program == "sitl-plant":
            own = load(config, PlantConfig).bind
        else:
            own = load(config, AutopilotConfig).formation_bind
        assert parse_address(own).host == address_of(name)


def test_autopilots_know_where_the_others_are(fleet: Path) -> None:
    station = parse_connection(SERVICES["gcs"]["environment"]["FTC_SITL_CONNECT"])
    assert station.direction == "in"
    assert station.address.host == address_of("gcs")
    for name in STARTED[1:]:
        config = load(fleet / f"{name}.yaml", AutopilotConfig)
        assert parse_address(config.plant).host == address_of("plant")
        assert config.gcs == (str(station.address),)
        for neighbour in config.neighbours:
            assert parse_address(neighbour.address).host == address_of(f"uav{neighbour.id}")


def test_addresses_are_of_the_network() -> None:
    (pool,) = COMPOSE["networks"]["fleet"]["ipam"]["config"]
    subnet = ipaddress.ip_network(pool["subnet"])
    addresses = [ipaddress.ip_address(address_of(name)) for name in (*STARTED, "gcs")]
    assert len(set(addresses)) == len(addresses)
    assert all(address in subnet for address in addresses)
    assert next(subnet.hosts()) not in addresses  # the gateway's


def test_every_volume_and_dependency_is_declared() -> None:
    for service in SERVICES.values():
        assert {volume.partition(":")[0] for volume in service["volumes"]} == set(
            COMPOSE["volumes"]
        )
        assert set(service.get("depends_on", ())) <= set(SERVICES)

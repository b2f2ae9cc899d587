"""Folders show the layers: imports go one way."""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ALLOWED: dict[str, set[str]] = {
    "mavlink_defs": set(),
    "sitl_plant": {"mavlink_defs"},
    "ftc_autopilot": {"mavlink_defs", "sitl_plant"},
    "gcs": {"mavlink_defs", "sitl_plant", "ftc_autopilot"},
}
MODEL = {"aerodynamics", "aircraft", "config", "hardware", "lag", "rigid_body", "vec3"}
"""Modules of `sitl_plant` that an autopilot may import: the aircraft's model, not its process."""
SHELLS = {
    "ftc_autopilot.__main__",
    "ftc_autopilot.autopilot",
    "ftc_autopilot.autopilots",
    "ftc_autopilot.process",
    "gcs.__main__",
    "gcs.cli",
    "gcs.fleet.flight",
    "gcs.fleet.fork_server",
    "gcs.fleet.forked",
    "gcs.fleet.hub_socket",
    "gcs.fleet.standing_record",
    "gcs.fleet.processes",
    "gcs.fleet.relays",
    "gcs.fleet.standing",
    "gcs.station.client",
    "mavlink_defs.capture.relay",
    "sitl_plant.__main__",
    "sitl_plant.process",
}
"""Modules that own a socket, a clock or a process, or start one that does."""
ABOVE = ("gcs.commands.", "gcs.lab.commands.", "gcs.testing.")
"""Packages on top of the shells."""
SYSTEM = {"asyncio", "selectors", "socket", "subprocess", "threading", "time"}
USERS_OF_THE_SYSTEM = SHELLS | {
    "ftc_autopilot.warm_up",
    "gcs.lab.campaigns.engine",
    "gcs.figures.style",
    "gcs.fleet.in_process",
    "gcs.fleet.precompile",
    "gcs.station.machine_runner",
    "gcs.tui.operations",
    "mavlink_defs.capture.tlog",
    "mavlink_defs.dialect",
    "mavlink_defs.endpoint",
    "mavlink_defs.framing.key_file",
    "mavlink_defs.framing.signing",
    "mavlink_defs.runtime.code_cache",
    "mavlink_defs.framing.link_signer",
    "mavlink_defs.runtime.native",
    "mavlink_defs.runtime.sockaddr",
    "sitl_plant.warm_up",
}


def modules(package: str) -> Iterator[tuple[str, Path]]:
    """Every module of a package, by its dotted name."""
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


@functools.cache
def imports(source: str) -> set[str]:
    """Dotted names that a source imports; of ``from a import b``, both a and a.b."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide which package is meant"
            names |= {f"{node.module}.{name.name}" for name in node.names} | {str(node.module)}
    return names


def test_every_way_to_import_a_module_is_seen() -> None:
    ways = (
        "import gcs.station.client",
        "import gcs.station.client as c",
        "from gcs.station import client",
        "from gcs.station.client import Client",
    )
    for source in ways:
        assert "gcs.station.client" in imports(source)
        assert "gcs.station.client" in imports(f"def later():\n    {source}")


def test_every_exemption_is_of_a_module() -> None:
    known = {module for package in ALLOWED for module, _ in modules(package)}
    assert known >= SHELLS | USERS_OF_THE_SYSTEM | {f"sitl_plant.{name}" for name in MODEL}


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_what_lies_below_it(package: str) -> None:
    for module, path in modules(package):
        used = {name.partition(".")[0] for name in imports(path.read_text())} & ALLOWED.keys()
        assert used - {package} <= ALLOWED[package], module


@pytest.mark.parametrize("package", ALLOWED)
def test_only_shells_import_shells(package: str) -> None:
    for module, path in modules(package):
        if module not in SHELLS and not module.startswith(ABOVE):
            assert not imports(path.read_text()) & SHELLS, module


def test_the_autopilot_knows_the_model_and_not_the_running_plant() -> None:
    for module, path in modules("ftc_autopilot"):
        used = {
            name.split(".")[1]
            for name in imports(path.read_text())
            if name.startswith("sitl_plant.")
        }
        assert used <= MODEL, module


@pytest.mark.parametrize("package", ALLOWED)
def test_no_socket_or_clock_in_machines(package: str) -> None:
    """Protocol machines, services and laws get bytes, arrays and the time as arguments."""
    for module, path in modules(package):
        if module not in USERS_OF_THE_SYSTEM and not module.startswith(ABOVE):
            assert not imports(path.read_text()) & SYSTEM, module

"""Folders show the layers: imports go one way."""

import ast
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
SHELL_FOLDERS = {"commands", "testing", "tui"}
SHELLS = {"process", "launcher", "client", "cli", "flight", "up", "relay", "wiring"}


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_what_lies_below_it(package: str) -> None:
    for path in (ROOT / package).rglob("*.py"):
        used = {module.partition(".")[0] for module in imports(path)} & ALLOWED.keys()
        assert used - {package} <= ALLOWED[package], path


@pytest.mark.parametrize("package", ALLOWED)
def test_only_shells_import_shells(package: str) -> None:
    for path in (ROOT / package).rglob("*.py"):
        if path.stem not in SHELLS and path.parent.name not in SHELL_FOLDERS:
            used = {module.rpartition(".")[2] for module in imports(path)
                    if module.partition(".")[0] in ALLOWED}  # fmt: skip
            assert not used & SHELLS, path


def test_the_autopilot_does_not_know_the_running_plant() -> None:
    for path in (ROOT / "ftc_autopilot").rglob("*.py"):
        used = {module for module in imports(path) if module.startswith("sitl_plant.")}
        assert not used & {"sitl_plant.process", "sitl_plant.fleet", "sitl_plant.actuators"}, path


@pytest.mark.parametrize("package", ALLOWED)
def test_no_socket_or_clock_in_machines(package: str) -> None:
    """Protocol machines, services and laws get bytes, arrays and the time as arguments."""
    thin = SHELLS | {"endpoint", "native", "jit", "warm_up", "lifetime", "closed_loop", "tlog",
                     "run_folder", "dialect", "operations", "signing"}  # fmt: skip
    for path in (ROOT / package).rglob("*.py"):
        if path.stem not in thin and path.parent.name not in SHELL_FOLDERS:
            assert not set(imports(path)) & {"socket", "time", "asyncio", "subprocess"}, path

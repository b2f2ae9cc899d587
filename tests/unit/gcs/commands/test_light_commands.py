"""What only talks to vehicles does not wait for what flies them."""

import subprocess
import sys

import pytest

HEAVY = {
    "distributed",
    "ftc_autopilot",
    "gcs.scenario.model",
    "matplotlib",
    "numba",
    "numpy",
    "pandas",
    "pyarrow",
    "scipy",
    "sitl_plant",
    "textual",
}
OF_WHAT_TALKS = {"asyncio", "gcs.station.client", "mavlink_defs.dialect", "rich.markdown"}
"""Not for help and versions."""
NOWHERE = ("--connect", "udpout:127.0.0.1:9", "--timeout", "0.1")
REPORTING = """
import os, sys
def report(event, _):
    if event == "socket.connect" or event == "at_end":
        os.write(2, " ".join(sys.modules).encode())
        os._exit(0)
sys.addaudithook(report)
from gcs.__main__ import main
try:
    main()
finally:
    sys.stdout.flush()
    sys.audit("at_end")
"""


@pytest.mark.parametrize(
    "command",
    [
        ("--version",),
        ("--help",),
        ("arm", "--help"),
        ("status", "--help"),
        ("status", *NOWHERE),
        ("arm", *NOWHERE),
        ("start", *NOWHERE),
        ("mode", "loiter", *NOWHERE),
        ("fault", "set", "rudder", "--effectiveness", "0.5", *NOWHERE),
        ("fault", "list", *NOWHERE),
        ("formation", "show", *NOWHERE),
        ("param", "list", *NOWHERE),
        ("param", "get", "TRIG_B1", "--uav", "1,3", *NOWHERE),
        ("param", "set", "TRIG_B1", "0.02", *NOWHERE),
    ],
    ids=" ".join,
)
def test_nothing_heavy_is_imported_before_a_command_listens(command: tuple[str, ...]) -> None:
    """The time itself is a row of ``make bench``."""
    done = subprocess.run(
        [sys.executable, "-c", REPORTING, *command], capture_output=True, text=True, check=True
    )
    modules = set(done.stderr.split())
    assert "gcs.commands.cli" in modules
    assert modules & HEAVY == set()
    assert "pydantic" not in modules or command[0] == "fault"  # whose options its models declare
    if command in {("--version",), ("arm", "--help")}:
        assert modules & OF_WHAT_TALKS == set()
    if command in {("--version",), ("arm", *NOWHERE)}:  # whose answers are lines
        assert "rich" not in modules


def test_the_entry_points_import_nothing_before_ctrl_c_is_silent() -> None:
    for package in ("gcs", "sitl_plant", "ftc_autopilot"):
        code = (
            "import signal, sys; before = set(sys.modules);"
            f"import {package}.__main__; print(*(set(sys.modules) - before))"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert set(done.stdout.split()) == {package, f"{package}.__main__"}


def test_nothing_is_left_to_search_for_garbage_at_the_end() -> None:
    code = (
        "import atexit, gc, sys; atexit.register(lambda: print(len(gc.get_objects())));"
        "sys.argv = ['gcs', '--version']; from gcs.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout.split()[-1]) < 1000


def test_a_scenario_is_read_and_checked_without_the_compiler() -> None:
    code = (
        "import sys; from gcs.scenario.model import load_scenario;"
        "load_scenario('paper/scenario1'); print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"

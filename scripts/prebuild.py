"""Make the machine code that a wheel carries: ``scripts/prebuild.py FOLDER``.

`hatch_build.py` runs it, with the package in `PYTHONPATH`, numba and, for old distributions,
ziglang. It flies what people fly, so that every function that Python calls is called.
"""

import ast
import sys
import tempfile
from pathlib import Path

import numpy as np

from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.control.laws import heading_loop
from ftc_autopilot.hot.checkpoint import checksum
from ftc_autopilot.warm_up import call_messages
from gcs.commands.cli import main as command_line
from gcs.fleet.in_process import fly_in_process
from gcs.fleet.precompile import PARTS
from gcs.results.beside import Beside
from gcs.results.recording import Steps
from gcs.scenario.changes import with_changes
from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.capture import delayed, tap_counts
from mavlink_defs.capture.impairing import new_directions
from mavlink_defs.capture.relay_loop import new_relay_state
from mavlink_defs.capture.tap import Tap
from mavlink_defs.framing.codec import SIM_STATE
from mavlink_defs.framing.hot_signing import new_link_signer, sign_bytes
from mavlink_defs.origin import Origin
from mavlink_defs.runtime.ahead_of_time import Calls
from mavlink_defs.runtime.native import ADDRESS_SIZE
from mavlink_defs.runtime.sources import ROOT
from sitl_plant.foreign.px4.instruments import Instruments
from sitl_plant.loop.fleet import loss_of, new_plant_state
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.simulators.own import OwnSimulator
from sitl_plant.vec3 import norm, scale, sub, vec3

FRAME = bytes(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(dialect.MAVLink(None, 1, 1)))
SHORT = ("--set", "duration_s=0.05", "--quiet")
FLIGHTS = (
    ("paper/scenario1", "--free-ports"),
    ("paper/scenario1", "--in-process", "--with", "estimated", "--with", "surviving"),
    ("missions/hexagon", "--in-process", "--with", "estimated"),
    ("missions/hexagon", "--in-process", "--with", "realistic"),
)
DECORATORS = {"compiled", "inlined", "apart"}
NOT_AHEAD = {
    "ftc_autopilot.control.laws.plugin:_command",
    "ftc_autopilot.control.triggers.plugin:_mask",
    "ftc_autopilot.guidance.laws.plugin:_output",
}
"""Parts of plug-ins of compiled Python, for which the compiler is asked for in any case."""
VEHICLES = (("estimated",), ("surviving",), ("tube",), ("realistic",))


def main(folder: Path) -> None:
    """Call every function that Python calls, and make machine code of such calls."""
    calls = Calls()
    with calls.listening(), tempfile.TemporaryDirectory() as runs:
        for call in PARTS.values():
            call()
        for number, flight in enumerate(FLIGHTS):
            run("fly", *flight, *SHORT, "--out", f"{runs}/{number}")
        run("aircraft", "aerosonde")
        run("design", "aerosonde", "--out", f"{runs}/designed.yaml")
        for additions in VEHICLES:
            scenario = with_changes("missions/hexagon", additions, {}, "additions")
            call_messages(scenario.autopilot_config(scenario.uavs[0].id))
        call_what_is_rare()
    if forgotten := python_calls() - calls.names - NOT_AHEAD:
        sys.exit(f"prebuild: Python calls what was not called here: {', '.join(sorted(forgotten))}")
    calls.build(folder)


def python_calls() -> set[str]:
    """Return our compiled functions, as of `name_of`, that plain code names, which may call them.

    What is compiled apart is none of them, as compiled code calls it, nor what runs `in_python`.
    """
    trees = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): ast.parse(
            path.read_text(encoding="utf-8")
        )
        for package in ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs")
        for path in (ROOT / package).rglob("*.py")
        if path.name != "dialect.py" and "project" not in path.parts
    }
    compiled = {
        f"{module}:{node.name}"
        for module, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and _decorators(node) & {"compiled", "inlined"}
    }
    return set().union(*(_named(module, tree, compiled) for module, tree in trees.items()))


def _named(module: str, tree: ast.Module, compiled: set[str]) -> set[str]:
    places = {name.partition(":")[2]: name for name in compiled if name.startswith(f"{module}:")}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            for one in node.names:
                places[one.asname or one.name] = f"{node.module}:{one.name}"
    waiting: list[ast.AST] = [tree]
    named = set()
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            named.add(places.get(node.id, ""))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            of = places.get(node.value.id, "").replace(":", ".")
            named.add(f"{of}:{node.attr}")
        if not _is_left_out(node):
            waiting += ast.iter_child_nodes(node)
    return named & compiled


def _is_left_out(node: ast.AST) -> bool:
    """Return whether a node is compiled itself, or takes compiled functions as plain Python."""
    if isinstance(node, ast.FunctionDef):
        return bool(_decorators(node) & DECORATORS)
    if not isinstance(node, ast.Call):
        return False
    return isinstance(node.func, ast.Name) and node.func.id == "in_python"


def _decorators(function: ast.FunctionDef) -> set[str]:
    called = (one.func if isinstance(one, ast.Call) else one for one in function.decorator_list)
    return {one.id for one in called if isinstance(one, ast.Name)}


def call_what_is_rare() -> None:
    """Call what runs when something is lost, restored, signed, impaired, relayed or counted."""
    scenario = load_scenario("paper/scenario1")
    fleet = new_plant_state(scenario.plant_config(speed=None))
    loss_of(fleet, 0)
    heading_loop(new_controllers([scenario.autopilot_config(2)]).uavs[0]["parameters"])
    checksum(np.zeros((2, 8), np.uint32)[0])
    sign_bytes(new_link_signer(bytes(range(32)), 0), FRAME)
    at_rest = vec3(np.zeros(3))
    norm(scale(1.0, sub(at_rest, at_rest)))
    sampled = Instruments(NavigationSensors(), Origin(), 1.2, 9.8, 1, 1, 1000)
    sampled.note(0, np.zeros(1, SIM_STATE)[0])
    simulator = OwnSimulator(scenario.aircraft_of(scenario.uavs[0].id))
    simulator.advance(0.0)
    target = np.zeros(ADDRESS_SIZE, np.uint8)
    new_relay_state(-1, [(-1, target)], [0, 1], [False, False], new_directions([]))
    tap = Tap()
    tap.count(0.0, "plant", "to", FRAME)
    tap.report()
    tap_counts.with_room(tap_counts.new_counts(window_s=1.0), len(FRAME))
    delayed.with_room(delayed.new_delayed(), len(FRAME), 1)
    Beside(scenario, scenario.uavs[0].id).add(Steps.room(1, 1), 0)
    fly_in_process(scenario.model_copy(update={"duration_s": 0.002})).error("command")


def run(*command: str) -> None:
    """Run a command of `gcs` in this process.

    Raises:
        SystemExit: It failed.
    """
    before = sys.argv
    sys.argv = ["gcs", *command]
    try:
        command_line()
    except SystemExit as ended:
        if ended.code:
            raise
    finally:
        sys.argv = before


if __name__ == "__main__":
    main(Path(sys.argv[1]))

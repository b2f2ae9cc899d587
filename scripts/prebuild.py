"""Make the machine code that a wheel carries: ``scripts/prebuild.py FOLDER``.

`hatch_build.py` runs it, with the package in `PYTHONPATH`, numba and, for old distributions,
ziglang. It flies what people fly, so that every function that Python calls is called.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.control.laws import heading_loop
from ftc_autopilot.hot.checkpoint import checksum
from ftc_autopilot.warm_up import call_messages
from gcs.commands.cli import main as command_line
from gcs.fleet.ardupilot.flight import ArduPilotFlight
from gcs.fleet.precompile import PARTS
from gcs.scenario.changes import with_changes
from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.capture.impairing import new_directions
from mavlink_defs.capture.relay_loop import new_relay_state
from mavlink_defs.capture.tap import Tap
from mavlink_defs.framing.hot_signing import new_link_signer, sign_bytes
from mavlink_defs.runtime.ahead_of_time import Calls
from mavlink_defs.runtime.native import ADDRESS_SIZE
from sitl_plant.loop.fleet import loss_of, new_plant_state
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
    calls.build(folder)


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
    ArduPilotFlight(scenario, print, print, print).load_code()
    simulator = OwnSimulator(scenario.aircraft_of(scenario.uavs[0].id))
    simulator.advance(0.0)
    target = np.zeros(ADDRESS_SIZE, np.uint8)
    new_relay_state(-1, [(-1, target)], [0, 1], [False, False], new_directions([]))
    tap = Tap()
    tap.count(0.0, "plant", "to", FRAME)
    tap.report()


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

"""Fleets for tests: read scenarios, choose ports, fly them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args

from gcs.console.errors import BadInput, python_errors
from gcs.console.terminal import console_of
from gcs.fleet.in_process import fly_in_process
from gcs.fleet.ports import on_free_ports
from gcs.fleet.preparation import How, Prepared, prepare
from gcs.fleet.remarks import warn
from gcs.fleet.warm_up import warm_up
from gcs.scenario.model import Scenario, scenario_tree
from gcs.testing.flying import TestFleet
from gcs.testing.results import FlightResult
from mavlink_defs.endpoint import UdpAddress

FlightMode = Literal["wire", "in_process"]


def prepared(
    path: Path, changes: Mapping[str, Any], speed: float | None, mode: FlightMode = "wire"
) -> Prepared:
    """Prepare the flight of a test, as `gcs.fly` does.

    Args:
        path: Scenario file.
        changes: Values by top-level key or path (``trigger.b2_deg``), merged as by `extends`:
            mappings merge, None removes. With `autopilot`, "ardupilot" say, and its keys such as
            `binary`, that flies every UAV in place of ours.
        speed: Real-time factor; None for lockstep.
        mode: Whether it flies over UDP or in process.

    Raises:
        BadInput: The file or the changes cannot be used; the text has every problem.
    """
    with python_errors():
        if mode not in get_args(FlightMode):
            raise BadInput(f"mode: expected 'wire' or 'in_process', got {mode!r}")
        how = How(over_udp=mode == "wire", speed=speed, free_ports=True)
        flight = prepare(path, how, values=_with_autopilot(path, dict(changes)))
    warn(flight.remarks)
    warm_up(flight.scenario, console_of(quiet=True), in_process=not how.over_udp)
    return flight


def _with_autopilot(path: Path, changes: dict[str, Any]) -> dict[str, Any]:
    """Return changes by which every UAV has `autopilot` and its keys."""
    kind = changes.pop("autopilot", None)
    if kind is None:
        return changes
    keys = {name: str(changes.pop(name)) for name in ("binary", "defaults") if name in changes}
    uavs = scenario_tree(path)["uavs"]
    return changes | {f"uavs[{i}].autopilot": {"kind": kind, **keys} for i in range(len(uavs))}


def launch(flight: Prepared, folder: Path) -> TestFleet:
    """Start a fleet on free ports; the caller must close it.

    Args:
        flight: What it is to fly.
        folder: Existing folder for the files of the processes.

    Raises:
        GcsError: As of `TestFleet.open`.
    """
    scenario = flight.scenario
    links = scenario.links.model_copy(update={"plant_relay": None})

    def opened(scenario: Scenario, _hub: UdpAddress) -> TestFleet:
        fleet = TestFleet(scenario, folder, flight.how.speed)
        fleet.open()
        return fleet

    return on_free_ports(scenario.model_copy(update={"links": links}), opened)


def fly(flight: Prepared, folder: Path) -> FlightResult:
    """Fly to the end of the scenario, or until it is lost; arguments as of `launch`."""
    if not flight.how.over_udp:
        return FlightResult(flight.scenario, fly_in_process(flight.scenario))
    fleet = launch(flight, folder)
    try:
        fleet.begin()
        return fleet.run_to_end()
    finally:
        fleet.close()

"""Fleets for tests: read scenarios, choose ports, fly them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from gcs.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.fleet.ports import on_free_ports
from gcs.fleet.precompile import compile_everything
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.testing.flying import TestFleet
from gcs.testing.results import FlightResult
from mavlink_defs.config.inherit import PlaceError, with_values
from mavlink_defs.config.models import ConfigError
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.runtime.code_cache import cache_is_cold

FlightMode = Literal["wire", "in_process"]


def read_scenario(path: Path, changes: Mapping[str, Any]) -> Scenario:
    """Read a scenario and lay changes over it.

    Args:
        path: Scenario file.
        changes: Values by top-level key or path (``trigger.b2_deg``), merged as by `extends`:
            mappings merge, None removes.

    Raises:
        BadInput: The file or the changes cannot be used; the text has every problem.
    """
    try:
        scenario = scenario_of(path, with_values(scenario_tree(path), changes))
    except ConfigError as problem:
        raise BadInput(str(problem)) from None
    except PlaceError as problem:
        raise BadInput(f"{path}: {problem}") from None
    if cache_is_cold():
        compile_everything(scenario)
    return scenario


def launch(scenario: Scenario, folder: Path, speed: float | None) -> TestFleet:
    """Start a fleet on free ports; the caller must close it.

    Args:
        scenario: On any ports.
        folder: Existing folder for the files of the processes.
        speed: Real-time factor; None for lockstep.

    Raises:
        GcsError: As of `TestFleet.open`.
    """
    links = scenario.links.model_copy(update={"plant_relay": None})

    def opened(scenario: Scenario, _hub: UdpAddress) -> TestFleet:
        fleet = TestFleet(scenario, folder, speed)
        fleet.open()
        return fleet

    return on_free_ports(scenario.model_copy(update={"links": links}), opened)


def fly(scenario: Scenario, folder: Path, speed: float | None, mode: FlightMode) -> FlightResult:
    """Fly a scenario to its end, or until it is lost; arguments as of `launch`."""
    if mode == "in_process":
        if speed is not None or scenario.links.impairments is not None:
            raise BadInput("speed and links.impairments apply to processes; mode is 'in_process'")
        return FlightResult(scenario, fly_in_process(scenario))
    if mode != "wire":
        raise BadInput(f"mode: expected 'wire' or 'in_process', got {mode!r}")
    fleet = launch(scenario, folder, speed)
    try:
        fleet.begin()
        return fleet.run_to_end()
    finally:
        fleet.close()

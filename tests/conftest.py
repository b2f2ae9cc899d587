import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from gcs.fleet.precompile import compile_everything
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.runtime.code_cache import cache_is_cold
from sitl_plant.aircraft import aircraft_record

pytest_plugins = ["leftovers", "needs", "pytester", "warm_flights"]

# the first call of a function compiles it; few examples and always the same, but by `make explore`
settings.register_profile("ftc-sitl", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("explore", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("ftc-sitl")

DATA = Path(__file__).parent / "data"
SCENARIO_1 = Path(__file__).parent.parent / "scenarios" / "paper" / "scenario1.yaml"


def pytest_configure(config: pytest.Config) -> None:
    """Compile once, before workers and their fleets would all do it at the same time."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # in the background of a shell script
        signal.signal(signal.SIGINT, signal.default_int_handler)  # children get Ctrl-C all the same
    if not hasattr(config, "workerinput") and cache_is_cold():
        compile_everything(load_scenario(SCENARIO_1))


@pytest.fixture(scope="session")
def vectors() -> dict[str, Any]:
    vectors: dict[str, Any] = json.loads((DATA / "vectors.json").read_text())
    return vectors


@pytest.fixture(scope="session")
def scenario1() -> Scenario:
    return load_scenario(SCENARIO_1)


@pytest.fixture(scope="session")
def nominal(scenario1: Scenario) -> np.void:
    """The paper's aircraft, Table I."""
    return aircraft_record(scenario1.aircraft)

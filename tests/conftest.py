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

TESTS = Path(__file__).parent
DATA = TESTS / "data"
SCENARIO_1 = TESTS.parent / "scenarios" / "paper" / "scenario1.yaml"


def pytest_configure(config: pytest.Config) -> None:
    """Compile once, before workers and their fleets would all do it at the same time."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # in the background of a shell script
        signal.signal(signal.SIGINT, signal.default_int_handler)  # children get Ctrl-C all the same
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:  # under nohup
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if not hasattr(config, "workerinput") and cache_is_cold():
        compile_everything(load_scenario(SCENARIO_1))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the files that start processes, and wait, among the ones that compute; these end."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    waiting = [path for path in files if "sitl" in path.relative_to(TESTS).parts]
    computing = [path for path in files if path not in waiting]
    place = {
        path: share * (k + 0.5) / len(group)
        for group, share in ((waiting, 0.9), (computing, 1.0))
        for k, path in enumerate(group)
    }
    items[:] = [item for path in sorted(files, key=place.__getitem__) for item in files[path]]


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

import gc
import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from gcs.fleet.precompile import compile_parts
from gcs.scenario.model import Scenario, load_scenario
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

pytest_plugins = ["leftovers", "needs", "pytester", "warm_flights"]

# the first call of a function compiles it; few examples and always the same, but by `make explore`
settings.register_profile("ftc-sitl", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("explore", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("ftc-sitl")

TESTS = Path(__file__).parent
DATA = TESTS / "data"
SCENARIO_1 = TESTS.parent / "scenarios" / "paper" / "scenario1.yaml"


BEYOND_THE_PAPER = {
    "cL_q": 7.0, "cL_de": 0.2,
    "cD_alpha": 0.05, "cD_alpha2": 1.2, "cD_beta": -0.01, "cD_beta2": 0.2, "cD_de": 0.02,
    "cD_de2": 0.08, "cY0": 0.002, "cY_p": -0.1, "cY_r": 0.15, "cY_da": 0.05, "cY_dr": 0.12,
}  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Compile once, before workers and their fleets would all do it at the same time."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # in the background of a shell script
        signal.signal(signal.SIGINT, signal.default_int_handler)  # children get Ctrl-C all the same
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:  # under nohup
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if not hasattr(config, "workerinput"):
        compile_parts()


def pytest_collectstart() -> None:
    """Search for no garbage while tests are collected: almost all that is made then stays."""
    gc.disable()


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


def pytest_collection_finish() -> None:
    """Search what is imported, and the tests, for garbage no more: a third of a dashboard's start.

    What is made from here on is searched as ever, but less often.
    """
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 20, 50)


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


@pytest.fixture(scope="session")
def general_aircraft(scenario1: Scenario) -> Aircraft:
    """The same with forces of all that moves, of surfaces, and a drag polar; sizes as usual."""
    tree = scenario1.aircraft.model_dump()
    tree["coefficients"] |= BEYOND_THE_PAPER
    return Aircraft.model_validate(tree)


@pytest.fixture(scope="session")
def general(general_aircraft: Aircraft) -> np.void:
    """Its record."""
    return aircraft_record(general_aircraft)


PROPULSION = {
    "thrust": [
        {"airspeed_m_s": 20.0, "thrust_n": 2600.0},
        {"airspeed_m_s": 40.0, "thrust_n": 1400.0},
        {"airspeed_m_s": 60.0, "thrust_n": 600.0},
    ],
    "torque_arm_m": -0.05, "pitch_arm_m": 0.1, "yaw_arm_m": 0.03, "lag_s": 0.3,
}  # fmt: skip


@pytest.fixture(scope="session")
def propelled_aircraft(general_aircraft: Aircraft) -> Aircraft:
    """The same with a thrust that depends on the airspeed, has a lag and makes moments."""
    return Aircraft.model_validate(general_aircraft.model_dump() | {"propulsion": PROPULSION})


@pytest.fixture(scope="session")
def propelled(propelled_aircraft: Aircraft) -> np.void:
    """Its record."""
    return aircraft_record(propelled_aircraft)


@pytest.fixture(scope="session")
def per_rad_s(general: np.void) -> np.void:
    """The same with rate derivatives per rad/s."""
    record: np.void = general.copy()
    record["per_rad_s"] = 1
    for name in ("cl_p", "cl_r", "cn_p", "cn_r", "cY_p", "cY_r"):
        record[name] *= general["b"] / 90.0
    for name in ("cm_q", "cL_q"):
        record[name] *= general["c_bar"] / 90.0
    return record


@pytest.fixture(params=["nominal", "general", "per_rad_s"])
def any_aircraft(request: pytest.FixtureRequest) -> np.void:
    """Each of them."""
    return request.getfixturevalue(request.param)

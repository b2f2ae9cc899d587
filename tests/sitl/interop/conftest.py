"""A fleet for other people's ground stations: real time, unarmed, waiting."""

from collections.abc import Iterator
from typing import Any

import pytest
from flying import free_links, processes_of, scenario_tree
from standing import Standing

from gcs.launcher import Fleet
from gcs.scenario import scenario_of

LONG_ENOUGH_S = 300.0


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Standing]:
    """Scenario 1 of the paper, without its fault, on free ports; nothing of it is left."""
    folder = tmp_path_factory.mktemp("fleet")
    tree: dict[str, Any] = scenario_tree(duration_s=LONG_ENOUGH_S, faults=[], links=free_links())
    scenario = scenario_of(folder / "scenario.yaml", tree)
    with Fleet(scenario, speed=1.0, folder=folder):
        yield Standing(scenario, folder)
    assert processes_of(folder) == {}

"""A fleet for other people's ground stations: slow, unarmed, waiting."""

from collections.abc import Iterator
from typing import Any

import pytest
from flying import scenario_tree, standing
from standing import Standing

from gcs.scenario.model import scenario_of

LONG_ENOUGH_S = 300.0


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Standing]:
    """Scenario 1 of the paper, without its fault, on free ports; nothing of it is left."""
    folder = tmp_path_factory.mktemp("fleet")
    tree: dict[str, Any] = scenario_tree(duration_s=LONG_ENOUGH_S, faults=[])
    with standing(scenario_of(folder / "scenario.yaml", tree), folder, speed=0.3) as scenario:
        yield Standing(scenario, folder)

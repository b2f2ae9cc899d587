from collections.abc import Iterator

import pytest
from link_bench import Rig

from gcs.scenario.model import Scenario


@pytest.fixture
def rig(scenario1: Scenario) -> Iterator[Rig]:
    rig = Rig(scenario1)
    yield rig
    rig.close()

"""Fleets that a whole-process test starts itself are as warm as those of its commands."""

from collections.abc import Iterator

import pytest
from warm import start_warm_flight_server

from gcs.fleet import forked


@pytest.fixture(scope="module", autouse=True)
def _warm_flights(request: pytest.FixtureRequest) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        if forked.FORKS and request.node.get_closest_marker("sitl"):
            patch.setattr(forked, "_start_server", start_warm_flight_server)
        yield

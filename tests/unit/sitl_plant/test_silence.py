"""A plant whose autopilot has fallen silent."""

import time
from collections.abc import Iterator

import numpy as np
import pytest

from gcs.scenario.model import Scenario
from tests.unit.sitl_plant.test_process import Rig


@pytest.fixture
def rig(scenario1: Scenario) -> Iterator[Rig]:
    """Return a plant whose UAV 1 was registered long ago; the others were never heard."""
    rig = Rig(scenario1)
    assert rig.register(rig.first, time.monotonic() - 1e3)
    yield rig
    for sock in (rig.sock, rig.first, rig.second):
        sock.close()


def wait_for_restart(rig: Rig, wait: bool) -> None:
    rig.plant._config = rig.plant._config.model_copy(update={"wait_for_restart": wait})


def test_before_the_start_a_silent_autopilot_is_forgotten_and_may_register_again(rig: Rig) -> None:
    wait_for_restart(rig, False)
    assert rig.plant._look_around() is None
    assert not rig.link.known.any()
    assert rig.register(rig.second, time.monotonic())


def test_in_flight_a_silent_autopilot_ends_the_flight(rig: Rig) -> None:
    wait_for_restart(rig, False)
    rig.plant._start()
    why = rig.plant._look_around()
    assert why is not None
    assert why.startswith("the autopilot of UAV 1 has been silent for")


def test_in_flight_a_silent_autopilot_is_waited_for_with_its_last_command_held(
    rig: Rig, capfd: pytest.CaptureFixture[str]
) -> None:
    wait_for_restart(rig, True)
    rig.plant._start()
    held = rig.plant._fleet.controls.copy()
    assert rig.plant._look_around() is None
    assert "holding its last command and waiting for it to come back" in capfd.readouterr().err
    assert not rig.link.known.any()
    assert np.array_equal(rig.plant._fleet.controls, held)
    assert rig.plant._look_around() is None  # said once
    assert capfd.readouterr().err == ""
    assert rig.register(rig.second, time.monotonic())
    assert "the autopilot of UAV 1 is back" in capfd.readouterr().err


def test_an_autopilot_that_is_heard_is_not_silent(rig: Rig) -> None:
    wait_for_restart(rig, False)
    rig.plant._start()
    rig.link.heard_s[:] = time.monotonic() + 1e3
    assert rig.plant._look_around() is None
    assert rig.link.known.tolist() == [1, 0, 0]

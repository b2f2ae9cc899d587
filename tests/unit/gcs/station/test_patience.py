"""A slow vehicle is waited for as long as it is heard; one that falls silent is given up."""

import asyncio
import math
from typing import Any

import pytest
from slow_vehicle import STEP_S, Operation, SlowVehicle

from gcs.console.errors import NoAnswer
from gcs.station.patience import ENDLESS, HASTY, USUAL, Patience
from gcs.station.vehicle import Vehicle
from mavlink_defs.profile import Segment

SEGMENT = Segment(0.0, 40.0, 0.0, 0.0, 0.0, ramp=False)
OPERATIONS: dict[str, Operation] = {
    "command": Vehicle.arm,
    "upload": lambda vehicle: vehicle.upload_profile([SEGMENT]),
    "download": Vehicle.download_mission,
    "parameter": lambda vehicle: vehicle.get_param("B1"),
    "parameters": Vehicle.list_params,
    "faults": Vehicle.faults,
}


def run(slow: SlowVehicle, name: str) -> Any:
    return asyncio.run(slow.until_done(OPERATIONS[name]))


@pytest.mark.parametrize("latency_s", [0.3, 6.0, 15.0])
@pytest.mark.parametrize("name", sorted(OPERATIONS.keys() - {"faults"}))
def test_a_slow_vehicle_that_is_heard_is_waited_for(name: str, latency_s: float) -> None:
    slow = SlowVehicle(latency_s, math.inf, USUAL)
    run(slow, name)
    if name == "upload":
        assert len(slow.mission.items) == 2


@pytest.mark.parametrize("name", OPERATIONS)
def test_one_that_falls_silent_is_given_up_soon(name: str) -> None:
    slow = SlowVehicle(30.0, 2.0, USUAL)
    with pytest.raises(NoAnswer) as problem:
        run(slow, name)
    assert slow.now < 12.0
    if not name.startswith("parameter"):
        assert ": silent for" in str(problem.value)


def test_one_that_is_heard_and_never_answers_is_given_up_in_the_end() -> None:
    slow = SlowVehicle(math.inf, math.inf, Patience(answer_s=20.0))
    with pytest.raises(NoAnswer, match="did not answer MAV_CMD_COMPONENT_ARM_DISARM, though it st"):
        run(slow, "command")
    assert 20.0 <= slow.now < 23.0


def test_nobody_waits_for_what_is_asked_by_the_way() -> None:
    slow = SlowVehicle(math.inf, math.inf, HASTY)
    with pytest.raises(NoAnswer):
        run(slow, "command")
    assert slow.now < 5.0


def test_whoever_sees_it_live_waits_through_any_silence() -> None:
    slow = SlowVehicle(1.0, math.inf, ENDLESS)
    slow._beat_s = 300.0
    slow._latency_s = 200.0
    run(slow, "command")
    assert slow.now > 200.0


@pytest.mark.parametrize("latency_s", [0.3, 1.2, 6.0])
def test_late_answers_to_one_command_do_not_answer_the_next(latency_s: float) -> None:
    """Each of two equal commands is answered by the vehicle's handling of its own."""
    slow = SlowVehicle(latency_s, math.inf, USUAL)

    async def two(vehicle: Vehicle) -> None:
        await vehicle.arm()
        await vehicle.arm()

    begun = slow.now
    asyncio.run(slow.until_done(two))
    assert slow.now - begun >= min(2.0 * latency_s, latency_s + 2.0) - STEP_S

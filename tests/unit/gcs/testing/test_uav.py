"""A UAV of a test has the operations of a vehicle, without ``await``."""

import asyncio
import inspect
import math

import pytest
from slow_vehicle import SlowVehicle

from gcs import Uav
from gcs.console.errors import BadInput, NoAnswer
from gcs.station.patience import HASTY, USUAL, Patience
from gcs.station.vehicle import Vehicle
from gcs.testing.uav import FlyingUav
from mavlink_defs.profile import Segment

OF_THE_CLIENT = {"ask_for_fleet", "ask_for_private", "ask_what_is_due"}
"""Operations that keep its own knowledge up to date."""


def uav(
    silent_from_s: float = math.inf, patience: Patience = USUAL
) -> tuple[FlyingUav, SlowVehicle]:
    slow = SlowVehicle(0.3, silent_from_s, patience)
    done = FlyingUav(
        slow.vehicle, lambda work: asyncio.run(slow.until_done(lambda _: work)), lambda *_: 7
    )
    return done, slow


def test_it_has_all_operations_with_their_arguments_and_texts() -> None:
    operations = {
        operation.__name__: operation  # once, under its first name
        for name, operation in inspect.getmembers(Vehicle, inspect.iscoroutinefunction)
        if not name.startswith("_") and name not in OF_THE_CLIENT
    }
    assert {"arm", "set_sensor_fault", "clear_sensor_faults", "upload_mission"} < operations.keys()
    for name, operation in operations.items():
        plain = getattr(FlyingUav, name)
        assert not inspect.iscoroutinefunction(plain), name
        if name != "command":  # takes its parameters one by one
            assert inspect.signature(plain) == inspect.signature(operation), name
            assert plain.__doc__ == operation.__doc__, name
    assert Uav is Vehicle


def test_each_returns_what_the_vehicle_answered() -> None:
    one, slow = uav()
    one.arm()
    one.start()
    one.command(400, 1.0)
    one.set_fault("rudder", effectiveness=0.5)
    one.clear_sensor_faults("gyro", instance=1)
    one.upload([Segment(0.0, 40.0, 0.0, 0.0, 0.0, ramp=False)])
    assert len(slow.mission.items) == 2
    assert one.get_param("B1").value == 0.25
    assert (one.id, one.sent("rudder"), one.state) == (7, 7, slow.state)
    assert repr(one) == repr(slow.vehicle) == "<UAV 7>"


def test_a_mistake_or_silence_is_raised() -> None:
    one, _ = uav(silent_from_s=0.0, patience=HASTY)
    with pytest.raises(BadInput, match="actuator: expected 'aileron'"):
        one.set_fault("flaps", effectiveness=0.5)
    with pytest.raises(BadInput, match=r"expected aileron, .* got 'flaps'"):
        one.clear_faults("flaps")
    with pytest.raises(BadInput, match="no such file"):
        one.upload_mission("nowhere.plan")
    with pytest.raises(NoAnswer, match="UAV 7 did not answer"):
        one.arm()
